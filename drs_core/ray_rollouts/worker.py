"""What runs in a worker process of the cluster."""

from __future__ import annotations

import socket
import time
import traceback
from collections.abc import Callable

import drs_core
from drs_core.accelerator import Runner, make_runner
from drs_core.agent import Agent
from drs_core.errors import DrsError
from drs_core.policy import Float32
from drs_core.ray_rollouts.messages import Answer, Batch
from drs_core.rollouts.proof import Proof
from drs_core.rollouts.task import run_task

_runners: dict[tuple[str, str], Runner] = {}
"""The simulator of this process, kept from task to task."""
_proved: list[Proof] = []
"""Of the newest theta, so that each is looked at once."""


def run_batch(batch: Batch, agent: Callable[[], Agent], theta: Float32) -> Answer:
    """Run tasks, one after the other, at theta (d,) float32; `agent` is called where this process has another one."""
    begun = time.perf_counter()
    try:
        _check(batch.proof, theta)
        runner = _runner(batch, agent)
        try:
            episodes = [run_task(runner, theta, task) for task in batch.tasks]
        except BaseException:
            # also where Ray cancels the task: a simulator may hold what broke the episode, whatever is reset
            _close()
            raise
    except DrsError as error:
        return Answer((), error=str(error), exit_status=error.exit_status)
    except Exception:
        return Answer((), error=traceback.format_exc())
    return Answer(episodes, time.perf_counter() - begun)


def _check(proof: Proof, theta: Float32) -> None:
    if _proved != [proof]:
        why = proof.difference(Proof.of(theta))
        if why:
            where = f"The worker on {socket.gethostname()} ({drs_core.__path__[0]})"
            raise DrsError(f"{where} cannot take part: {why}; install the same on every machine of the cluster.")
        _proved[:] = [proof]


def _runner(batch: Batch, agent: Callable[[], Agent]) -> Runner:
    key = batch.agent_digest, batch.backend
    if key not in _runners:
        _close()
        _runners[key] = make_runner(agent(), batch.backend)
    return _runners[key]


def _close() -> None:
    while _runners:
        _runners.popitem()[1].close()
