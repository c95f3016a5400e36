"""How long answers took, and how many came too late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_LATE = 1.5


@dataclass(frozen=True)
class Timing:
    """Figures of the newest answers.

    Attributes:
        median_s, p99_s, worst_s: from inputs to a published command; 0 before the first.
        missed: periods without an answer, of all since the start.
    """

    median_s: float
    p99_s: float
    worst_s: float
    missed: int


class Stopwatch:
    """Keeps the newest durations, in one array."""

    def __init__(self, period_s: float, keep: int = 1500) -> None:
        """Begin with none.

        Args:
            period_s: time between two answers.
            keep: so many are kept; 1500 are a minute at 25 Hz.
        """
        self._period_s, self._durations = period_s, np.zeros(keep)
        self.restart()
        # numpy loads modules at the first call, which takes longer than an answer
        _quantiles(self._durations)

    def restart(self) -> None:
        """Forget everything."""
        self._count = self._missed = 0
        self._last_s: float | None = None

    def add(self, duration_s: float, now_s: float) -> None:
        """An answer that took so long, at a moment of the clock that periods are of."""
        self._durations[self._count % len(self._durations)] = duration_s
        self._count += 1
        if self._last_s is not None and now_s - self._last_s > _LATE * self._period_s:
            self._missed += round((now_s - self._last_s) / self._period_s) - 1
        self._last_s = now_s

    def figures(self) -> Timing:
        """Figures of what is kept."""
        kept = self._durations[: self._count]
        if not len(kept):
            return Timing(0.0, 0.0, 0.0, self._missed)
        return Timing(*_quantiles(kept), self._missed)


def _quantiles(durations: NDArray[np.float64]) -> tuple[float, float, float]:
    median, p99, worst = np.quantile(durations, (0.5, 0.99, 1.0)).tolist()
    return median, p99, worst
