"""Rollouts in this process, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

from drs_core.accelerator import make_runner
from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.policy import Float32
from drs_core.rollouts.task import Progress, Task, run_task


class InProcess:
    """The protocol `Rollouts` without workers."""

    def __init__(self, agent: Agent, backend: str = "python") -> None:
        """Make the agent's environment."""
        self._runner = make_runner(agent, backend)

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """Every task's episode, in the order of tasks."""
        episodes = []
        for task in tasks:
            episodes.append(run_task(self._runner, theta, task))
            if progress:
                progress(len(episodes))
        return episodes

    def close(self) -> None:
        """Free the simulator."""
        self._runner.close()
