"""What goes to a worker process of the cluster, and what comes back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any

from drs_core.episode import Episode
from drs_core.rollouts.proof import Proof
from drs_core.rollouts.task import Task
from drs_core.scope import Scope
from drs_core.search import Perturbation


@dataclass(frozen=True)
class Batch:
    """What a task is asked for: `tasks` on `backend` by the agent of this digest, and the proof of theta."""

    agent_digest: str
    backend: str
    proof: Proof
    tasks: Sequence[Task]

    def plain(self) -> tuple[Any, ...]:
        """The same as strings and numbers, which Ray unpacks whatever classes a worker has."""
        tasks = [(task.seed, tuple(task.measure), _numbers(task.perturbation)) for task in self.tasks]
        return self.agent_digest, self.backend, astuple(self.proof), tasks

    @classmethod
    def of(cls, plain: tuple[Any, ...]) -> Batch:
        """From its plain form."""
        digest, backend, proof, tasks = plain
        made = [Task(seed, frozenset(measure), _perturbation(numbers)) for seed, measure, numbers in tasks]
        return cls(digest, backend, Proof(*proof), made)


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


def _numbers(p: Perturbation | None) -> tuple[float, ...] | None:
    if p is None:
        return None
    return p.run_seed, p.update, p.direction, p.sign, p.sigma, p.scope.start, p.scope.gains


def _perturbation(numbers: tuple[Any, ...] | None) -> Perturbation | None:
    if numbers is None:
        return None
    seed, update, direction, sign, sigma, start, gains = numbers
    return Perturbation(seed, update, direction, sign, sigma, Scope(start, gains))
