"""What the search maximises: functions of one Episode, registered by name."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from drs_core.episode import DIMENSION, Episode
from drs_core.errors import UsageError

SMALLEST_DIMENSION = 1e-3
"""Keeps R / D finite for a trajectory that never leaves one point."""
KAPPA = 6.0
"""What all of the baseline's action change is worth to `smooth`, in standard deviations of its return."""
BASELINE_EPISODES = 32
"""Episodes from which c is taken, once a run."""


@dataclass(frozen=True)
class Objective:
    """A named objective.

    Attributes:
        name: key of OBJECTIVES.
        smoothness_weight: c of ``smooth``, None where it is yet to come from the baseline; unused by the others.
    """

    name: str = "return"
    smoothness_weight: float | None = None

    def __post_init__(self) -> None:
        """Raise UsageError for an unknown name or a weight that is out of range."""
        if self.name not in OBJECTIVES:
            raise UsageError(f"There is no objective {self.name!r}; choose one of {', '.join(OBJECTIVES)}.")
        weight = self.smoothness_weight
        if weight is not None and not (math.isfinite(weight) and weight >= 0.0):
            raise UsageError(f"smoothness_weight {weight} is out of range: a finite number, 0 or more.")

    @property
    def needs_baseline(self) -> bool:
        """Whether it can value nothing before `weighed`."""
        return self.name == "smooth" and self.smoothness_weight is None

    def weighed(self, baseline: Sequence[Episode]) -> Objective:
        """The same objective with the weight that episodes of the baseline give."""
        returns, changes = zip(*((episode.return_, episode.action_change) for episode in baseline), strict=True)
        return replace(self, smoothness_weight=smoothness_weight(returns, changes))

    @property
    def measures(self) -> frozenset[str]:
        """What a rollout has to measure for it."""
        return frozenset({DIMENSION}) if self.name == "dimension" else frozenset()

    def __call__(self, episode: Episode) -> float:
        """The value of one episode."""
        if self.needs_baseline:
            raise ValueError("smooth has no weight yet")
        return OBJECTIVES[self.name](episode, self.smoothness_weight or 0.0)


def smoothness_weight(returns: Sequence[float], action_changes: Sequence[float]) -> float:
    """The weight that a baseline's episodes give: KAPPA * standard deviation of R / mean action change.

    Rewards in another unit, or moved by a constant, change nothing in the search. Where all returns
    are equal their size takes the place of their spread; where they are 0, c is 1, since only the
    change counts; where the action never changes there is nothing to smooth, and c is 0.
    """
    change = statistics.fmean(action_changes)
    if change == 0.0:
        return 0.0
    spread = statistics.pstdev(returns) or abs(returns[0])
    return KAPPA * spread / change if spread else 1.0


def _return(episode: Episode, _: float) -> float:
    return episode.return_


def _dimension(episode: Episode, _: float) -> float:
    """Equations 2 and 3 of the paper: R / D, or R * D where R is negative."""
    if episode.dimension is None:
        raise ValueError("the episode was run without measuring its dimension")
    return per_dimension(episode.return_, episode.dimension.clipped_mean())


def per_dimension(return_: float, dimension: float) -> float:
    """R / D, or R * D where R is negative; D is at least SMALLEST_DIMENSION."""
    d = max(dimension, SMALLEST_DIMENSION)
    return return_ / d if return_ >= 0.0 else return_ * d


def _smooth(episode: Episode, weight: float) -> float:
    return episode.return_ - weight * episode.action_change


OBJECTIVES: dict[str, Callable[[Episode, float], float]] = {
    "return": _return,
    "dimension": _dimension,
    "smooth": _smooth,
}
