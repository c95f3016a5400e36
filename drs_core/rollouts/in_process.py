"""Rollouts in this process, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

from drs_core.accelerator import Runner, make_runner
from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.policy import Float32
from drs_core.rollouts.task import Progress, Task, run_task


class InProcess:
    """The protocol `Rollouts` without workers."""

    def __init__(self, agent: Agent, backend: str = "python") -> None:
        """Make the agent's environment."""
        self._agent, self._backend = agent, backend
        self._runner: Runner | None = make_runner(agent, backend)

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """Every task's episode, in the order of tasks."""
        episodes = []
        for task in tasks:
            episodes.append(self._one(theta, task))
            if progress:
                progress(len(episodes))
        return episodes

    def close(self) -> None:
        """Free the simulator; it is made anew where another episode is asked for."""
        if self._runner is not None:
            runner, self._runner = self._runner, None
            runner.close()

    def _one(self, theta: Float32, task: Task) -> Episode:
        if self._runner is None:
            self._runner = make_runner(self._agent, self._backend)
        try:
            return run_task(self._runner, theta, task)
        except BaseException:
            # a simulator may hold what broke the episode, and no reset may take it away
            self.close()
            raise
