"""Rollouts in this process, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

from drs_core.agent import Agent
from drs_core.episode import Episode, EpisodeRunner
from drs_core.policy import Float32
from drs_core.rollouts.task import Progress, Task, run_task


class InProcess:
    """The protocol `Rollouts` without workers."""

    def __init__(self, agent: Agent, fast: bool = True) -> None:
        """Make the agent's environment; `fast` as in `Environment`."""
        self._runner = EpisodeRunner(agent, fast)

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
