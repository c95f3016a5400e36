"""The newest commands, and whether they have ended: what an arm does without them nobody says."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drs_core.serving.arm import JOINTS
from drs_core.serving.guards import SILENCE_S

Float64 = NDArray[np.float64]

EARLY = 0.5
"""A call that comes sooner than this part of its period after the last one is passed over."""
_GAP_S, _GAP_PERIODS, REST_S = 0.5 * SILENCE_S, 2.5, 2.0 * SILENCE_S
"""A gap between commands that ends a motion, and the time after its last command in which the arm comes to rest. A
controller's own limit lies far from both, so that there is no doubt of how it takes what follows."""
_KEPT_RAD = 0.01
"""An arm that rests so near its last command has kept it; what is between them is its controller's."""


class Commanded:
    """The last four commands of a motion, with their moments.

    Attributes:
        history: (4, 7) [rad], oldest first.
        silent: commands have ended while the policy is active, so that the next motion begins from rest.
    """

    def __init__(self, period_s: float) -> None:
        """`period_s`: between two commands."""
        self.history, self._period_s = np.zeros((4, JOINTS)), period_s
        self.forget()

    def forget(self) -> None:
        """The policy has stopped: what comes next is a start."""
        self.silent, self._last_s, self._last_steady_s = False, -math.inf, -math.inf

    def begin(self, positions: Float64) -> None:
        """A motion begins, from rest at positions (7,) [rad]."""
        self.forget()
        self.history[:] = positions

    def push(self, positions: Float64) -> None:
        """Put a command (7,) [rad] at the end of the history."""
        self.history[:-1] = self.history[1:]
        self.history[-1] = positions

    def published(self, now_s: float, steady_s: float | None) -> None:
        """The command was good, and is given at this moment of both clocks [s]."""
        self._last_s, self._last_steady_s = now_s, now_s if steady_s is None else steady_s

    def is_early(self, now_s: float) -> bool:
        """Whether the last command is less than a period ago."""
        return now_s - self._last_s < EARLY * self._period_s

    def gap(self, now_s: float, steady_s: float | None) -> float:
        """How long no command has come in a motion, where that ends it; else 0 [s].

        By the clock that shows less: one may have been set.
        """
        if self.silent or not math.isfinite(self._last_s):
            return 0.0
        gap_s = now_s - self._last_s
        if steady_s is not None:
            gap_s = min(gap_s, steady_s - self._last_steady_s)
        return gap_s if gap_s > max(_GAP_S, _GAP_PERIODS * self._period_s) else 0.0

    @property
    def moves(self) -> bool:
        """Whether the last four commands differ: after four equal ones, whatever comes next begins from rest."""
        return bool(np.ptp(self.history, axis=0).any())

    def may_still_move(self, now_s: float) -> bool:
        """Whether an arm whose motion was interrupted may not have come to rest yet."""
        return self.moves and now_s < self._last_s + REST_S

    def beginning(self, measured: Float64) -> Float64:
        """Where the next motion begins (7,) [rad]: at the last command, which is no jump, or where the arm is."""
        kept = self.silent and bool(np.abs(measured - self.history[-1]).max() <= _KEPT_RAD)
        return self.history[-1].copy() if kept else measured
