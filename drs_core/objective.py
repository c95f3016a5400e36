"""What the search maximises: functions of one Episode, registered by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from drs_core.episode import DIMENSION, Episode
from drs_core.errors import UsageError

SMALLEST_DIMENSION = 1e-3
"""Keeps R / D finite for a trajectory that never leaves one point."""
PANDA_SMOOTHNESS_WEIGHT = 5.0


@dataclass(frozen=True)
class Objective:
    """A named objective.

    Attributes:
        name: key of OBJECTIVES.
        smoothness_weight: c of ``smooth``; unused by the others.
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

    def for_environment(self, environment_id: str) -> Objective:
        """The same objective with its default weight filled in.

        Raises:
            UsageError: ``smooth`` has a default for Panda only, and none was given.
        """
        if self.name != "smooth" or self.smoothness_weight is not None:
            return self
        if not environment_id.startswith("Panda"):
            raise UsageError(
                f"The objective smooth needs smoothness_weight for {environment_id}: only Panda has a default "
                f"({PANDA_SMOOTHNESS_WEIGHT:g}). Choose about a tenth of the return for each unit of action change."
            )
        return Objective(self.name, PANDA_SMOOTHNESS_WEIGHT)

    @property
    def measures(self) -> frozenset[str]:
        """What a rollout has to measure for it."""
        return frozenset({DIMENSION}) if self.name == "dimension" else frozenset()

    def __call__(self, episode: Episode) -> float:
        """The value of one episode."""
        return OBJECTIVES[self.name](episode, self.smoothness_weight or 0.0)


def _return(episode: Episode, _: float) -> float:
    return episode.return_


def _dimension(episode: Episode, _: float) -> float:
    """Equations 2 and 3 of the paper: R / D, or R * D where R is negative."""
    if episode.dimension is None:
        raise ValueError("the episode was run without measuring its dimension")
    d = max(episode.dimension.clipped_mean(), SMALLEST_DIMENSION)
    return episode.return_ / d if episode.return_ >= 0.0 else episode.return_ * d


def _smooth(episode: Episode, weight: float) -> float:
    return episode.return_ - weight * episode.action_change


OBJECTIVES: dict[str, Callable[[Episode, float], float]] = {
    "return": _return,
    "dimension": _dimension,
    "smooth": _smooth,
}
