"""Where episodes happen: the protocol `Rollouts` and its implementations."""

from __future__ import annotations

from drs_core.agent import Agent
from drs_core.rollouts.attempts import ATTEMPTS, Attempted, check_enough, run_groups
from drs_core.rollouts.in_process import InProcess
from drs_core.rollouts.pool import ProcessPool
from drs_core.rollouts.task import Progress, Rollouts, Task

__all__ = [
    "ATTEMPTS",
    "Attempted",
    "InProcess",
    "ProcessPool",
    "Progress",
    "Rollouts",
    "Task",
    "check_enough",
    "local",
    "run_groups",
]


def local(agent: Agent, workers: int, backend: str = "python") -> Rollouts:
    """Rollouts on this machine: a pool of processes, or this process for workers = 0.

    `backend` runs every episode, or an error says why not: see `drs_core.accelerator.choose`.
    """
    return ProcessPool(agent, workers, backend) if workers else InProcess(agent, backend)
