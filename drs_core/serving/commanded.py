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
_KEPT_RAD = 0.1
"""An arm that rests so near its last command has kept it; what is between them is its controller's, gravity's too."""


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
        # of the first two commands nobody knows yet how far apart they are
        self._step_s = REST_S / _GAP_PERIODS

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
        if math.isfinite(self._last_s):
            self._step_s = self._since(now_s, steady_s)
        self._last_s, self._last_steady_s = now_s, now_s if steady_s is None else steady_s

    def is_early(self, now_s: float) -> bool:
        """Whether the last command is less than a period ago."""
        return now_s - self._last_s < EARLY * self._period_s

    def gap(self, now_s: float, steady_s: float | None) -> float:
        """How long no command has come in a motion, where that ends it; else 0 [s].

        Beside the period, the last two commands say what is usual: simulated time may go on in coarse steps.
        """
        if self.silent or not math.isfinite(self._last_s):
            return 0.0
        gap_s = self._since(now_s, steady_s)
        return gap_s if gap_s > max(_GAP_S, _GAP_PERIODS * max(self._period_s, self._step_s)) else 0.0

    def _since(self, now_s: float, steady_s: float | None) -> float:
        """Time since the last command, by the clock that shows less, since one may have been set [s]."""
        gap_s = now_s - self._last_s
        return gap_s if steady_s is None else min(gap_s, steady_s - self._last_steady_s)

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
