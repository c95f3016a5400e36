"""When a tuned agent is good enough."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from drs_core.episode import MOTION, Episode
from drs_core.measures.statistics import mean_interval

_SURELY_LESS = 3.0
"""Standard errors below a value, after which the rest of an evaluation is spared."""


@dataclass(frozen=True)
class Return:
    """The lower end of the mean return's 95 % interval is at least `value`."""

    value: float
    objective: ClassVar[str] = "return"
    measure: ClassVar[frozenset[str]] = frozenset()
    label: ClassVar[str] = "return"

    @property
    def line(self) -> float:
        """The value."""
        return self.value

    def shown(self, episodes: Sequence[Episode]) -> float:
        """Their mean return."""
        return float(np.mean([episode.return_ for episode in episodes]))

    def out_of_reach(self, episodes: Sequence[Episode]) -> bool:
        """Whether the mean is below the value, and not by chance."""
        returns = np.array([episode.return_ for episode in episodes])
        return bool(returns.mean() + _SURELY_LESS * returns.std() / math.sqrt(len(returns)) < self.value)

    def reached(self, episodes: Sequence[Episode]) -> bool:
        """Whether the interval says so."""
        return mean_interval([episode.return_ for episode in episodes]).low >= self.value


@dataclass(frozen=True)
class Smooth:
    """A Panda arm that shakes no more.

    Every episode ends at the goal, the return is not worse within its error, and in the goal region speed
    and squared jerk of the tip are at most these parts of the baseline's.

    Attributes:
        return_low: lower end of the baseline's mean return.
        speed: the baseline's mean tip speed [m/s].
        jerk: the baseline's mean squared jerk [(m/s^3)^2].
    """

    return_low: float
    speed: float
    jerk: float
    speed_part: float = 1 / 15
    jerk_part: float = 1 / 50
    objective: ClassVar[str] = "smooth"
    measure: ClassVar[frozenset[str]] = frozenset({MOTION})
    label: ClassVar[str] = "squared jerk / the baseline's"

    @property
    def line(self) -> float:
        """The part that may be left."""
        return self.jerk_part

    def shown(self, episodes: Sequence[Episode]) -> float:
        """The part of the baseline's squared jerk that is left."""
        return _motion(episodes)[1] / self.jerk

    @classmethod
    def of(cls, baseline: Sequence[Episode]) -> Smooth:
        """The bars that a baseline's episodes set."""
        low = mean_interval([episode.return_ for episode in baseline]).low
        return cls(low, *_motion(baseline))

    def out_of_reach(self, episodes: Sequence[Episode]) -> bool:
        """Whether it is far from them, or an episode has failed."""
        speed, jerk = _motion(episodes)
        far = speed > 3 * self.speed_part * self.speed or jerk > 3 * self.jerk_part * self.jerk
        return far or not all(episode.success for episode in episodes)

    def reached(self, episodes: Sequence[Episode]) -> bool:
        """Whether all bars are kept."""
        speed, jerk = _motion(episodes)
        smooth = speed <= self.speed_part * self.speed and jerk <= self.jerk_part * self.jerk
        high = mean_interval([episode.return_ for episode in episodes]).high
        return smooth and high >= self.return_low and all(episode.success for episode in episodes)


def _motion(episodes: Sequence[Episode]) -> tuple[float, float]:
    motions = [episode.motion for episode in episodes if episode.motion is not None]
    speeds, jerks = zip(*((motion.speed_mean, motion.jerk_mean_square) for motion in motions), strict=True)
    return float(np.mean(speeds)), float(np.mean(jerks))


Goal = Return | Smooth
