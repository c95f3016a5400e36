"""What one turn of one variant cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Sample:
    """One turn.

    Attributes:
        steps: environment steps taken.
        rollouts: episodes, or 0 where there are none (physics alone).
        cpu_s: CPU time of every process that took part [s].
        wall_s: wall time [s].
    """

    steps: int
    rollouts: int
    cpu_s: float
    wall_s: float

    @property
    def cpu_us_per_step(self) -> float:
        """CPU time of an environment step [us]."""
        return 1e6 * self.cpu_s / self.steps

    @property
    def wall_us_per_step(self) -> float:
        """Wall time of an environment step [us]."""
        return 1e6 * self.wall_s / self.steps


class Stopwatch:
    """Adds up the CPU and wall time [s] of the blocks that run inside `running`."""

    def __init__(self, cpu_clock: Callable[[], float] = time.process_time) -> None:
        """`cpu_clock` gives the CPU time so far of the processes that take part [s]."""
        self._clock, self.cpu_s, self.wall_s = cpu_clock, 0.0, 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Time this block."""
        cpu, wall = self._clock(), time.perf_counter()
        yield
        self.wall_s += time.perf_counter() - wall
        self.cpu_s += self._clock() - cpu


def play_until(steps: int, play: Callable[[], int]) -> Sample:
    """Whole episodes in this process until at least `steps` steps; play() runs one and returns its length."""
    taken = rollouts = 0
    watch = Stopwatch()
    with watch.running():
        while taken < steps:
            taken += play()
            rollouts += 1
    return Sample(taken, rollouts, watch.cpu_s, watch.wall_s)
