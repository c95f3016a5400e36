"""What of theta is searched: all of it, the last layer, or one gain for each action.

A gain multiplies a row of the last layer, an action's weights and its bias. A policy that shakes is often
a loop of too much gain: with gains alone that is one number of a few, in all of theta one direction among
tens of thousands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Scope:
    """What of theta (d,) a search perturbs and moves.

    Attributes:
        start: first parameter of it: 0, or where the last layer begins.
        gains: number of actions where the last layer, from `start` to the end, moves by its gains alone; else 0.
    """

    start: int = 0
    gains: int = 0

    def size(self, d: int) -> int:
        """Length of a direction: how many numbers are searched."""
        return self.gains or d - self.start

    def scaled(self, theta: NDArray[np.floating], factors: NDArray[np.floating]) -> NDArray[np.floating]:
        """The last layer of theta (d,), each action's weights and bias times its factor (gains,): (d - start,)."""
        split = len(theta) - self.gains
        weights = theta[self.start : split].reshape(self.gains, -1) * factors[:, None]
        return np.concatenate([weights.ravel(), theta[split:] * factors])


ALL = Scope()
