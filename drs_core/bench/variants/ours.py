"""This project: in this process, and in a pool of worker processes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

from drs_core.accelerator import PYTHON
from drs_core.agent import Agent
from drs_core.bench.processes import together
from drs_core.bench.sample import Sample, Stopwatch, play_until
from drs_core.bench.variants import Absent
from drs_core.errors import DrsError
from drs_core.rollouts import InProcess, ProcessPool, Rollouts, Task


class OneByOne:
    """Rollouts in this process."""

    def __init__(self, agent: Agent, rollouts: Rollouts) -> None:
        """`rollouts` run here, one after the other."""
        self._theta, self._rollouts = agent.theta, rollouts

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again."""
        return play_until(steps, lambda: self._rollouts.run(self._theta, [Task(seed)])[0].length)

    def close(self) -> None:
        """Free the simulator."""
        self._rollouts.close()


class Together:
    """Rollouts on several workers; every turn gives each the same number of equally long episodes.

    How well a pool deals with episodes of different lengths is measured apart, on a whole update.
    """

    def __init__(self, agent: Agent, rollouts: Rollouts, workers: int, cpu_clock: Callable[[], float]) -> None:
        """`cpu_clock` gives the CPU time so far of all processes that take part [s]."""
        self._theta, self.rollouts, self._workers, self._clock = agent.theta, rollouts, workers, cpu_clock
        self._episode_steps: dict[int, int] = {}

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again, at least four times for each worker."""
        count = episode_count(steps, self._episode_steps.get(seed), self._workers)
        watch = Stopwatch(self._clock)
        with watch.running():
            episodes = self.rollouts.run(self._theta, [Task(seed)] * count)
        self._episode_steps[seed] = episodes[0].length
        return Sample(sum(episode.length for episode in episodes), count, watch.cpu_s, watch.wall_s)

    def close(self) -> None:
        """End the workers."""
        self.rollouts.close()


def episode_count(steps: int, episode_steps: int | None, workers: int) -> int:
    """Episodes of at least `steps` steps in all, where one has episode_steps, and a multiple of 4 for each worker."""
    least = 4 * workers
    return least if episode_steps is None else least * math.ceil(steps / (least * episode_steps))


def in_process(agent: Agent, backend: str) -> OneByOne:
    """In this process, by a backend.

    Raises:
        Absent: a backend other than the usual one cannot run here, or not in this environment.
    """
    try:
        return OneByOne(agent, InProcess(agent, backend))
    except DrsError as error:
        if backend == PYTHON:
            raise
        raise Absent(str(error.__cause__ or error)) from error


def pool(agent: Agent, workers: int) -> Together:
    """In worker processes, by the backend that a run takes unless told otherwise."""
    rollouts = ProcessPool(agent, workers)
    return Together(agent, rollouts, workers, partial(_together, rollouts))


def _together(rollouts: ProcessPool) -> float:
    pids: Sequence[int] = rollouts.pids
    return together(pids)
