"""What the search asks for, and the protocol of whatever answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from drs_core.accelerator import Runner
from drs_core.episode import Episode
from drs_core.policy import Float32
from drs_core.search import Perturbation

Progress = Callable[[int], None]
"""Called with the number of episodes done so far."""


@dataclass(frozen=True)
class Task:
    """One rollout: a seed, what to measure, and how theta is perturbed (None: not at all)."""

    seed: int
    measure: frozenset[str] = frozenset()
    perturbation: Perturbation | None = None


class Rollouts(Protocol):
    """Somewhere that episodes happen: this process, a pool, a cluster, simulator nodes."""

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """Every task's episode, in the order of tasks, whichever worker ran it."""
        ...

    def close(self) -> None:
        """Free workers and simulators."""
        ...


def run_task(runner: Runner, theta: Float32, task: Task) -> Episode:
    """One task in this process."""
    runner.load(theta if task.perturbation is None else task.perturbation.candidate(theta))
    return runner.run(task.seed, task.measure)
