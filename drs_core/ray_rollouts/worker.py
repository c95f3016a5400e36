"""What runs in a worker process of the cluster."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass

from drs_core.accelerator import Runner, make_runner
from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.errors import DrsError
from drs_core.policy import Float32
from drs_core.rollouts.task import Task, run_task

_runners: dict[tuple[str, str], Runner] = {}
"""The simulator of this process, kept from task to task."""


@dataclass(frozen=True)
class Answer:
    """What a task gives.

    Attributes:
        episodes: in the order of its tasks; empty where one failed.
        duration_s: without the way.
        error: why one failed.
        exit_status: of the DrsError behind it; None with an error means a bug, and the error is its traceback.
    """

    episodes: Sequence[Episode]
    duration_s: float = 0.0
    error: str | None = None
    exit_status: int | None = None


def run_batch(agent: Agent, digest: str, backend: str, theta: Float32, tasks: Sequence[Task]) -> Answer:
    """Run tasks, one after the other, at theta (d,) float32."""
    begun = time.perf_counter()
    try:
        if (digest, backend) not in _runners:
            while _runners:
                _runners.popitem()[1].close()
            _runners[digest, backend] = make_runner(agent, backend)
        episodes = [run_task(_runners[digest, backend], theta, task) for task in tasks]
    except DrsError as error:
        return Answer((), error=str(error), exit_status=error.exit_status)
    except Exception:
        return Answer((), error=traceback.format_exc())
    return Answer(episodes, time.perf_counter() - begun)
