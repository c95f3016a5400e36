"""How long an episode lasts where the environment is a robot or simulates one, without making it."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class EpisodeTime:
    """The greatest length of an episode [steps], and the time of one step [s]."""

    steps: int
    step_s: float

    @property
    def seconds(self) -> float:
        """The greatest length of an episode [s]."""
        return self.steps * self.step_s

    def __str__(self) -> str:
        """In words."""
        return f"{self.seconds:.3g} s ({self.steps} steps at {1.0 / self.step_s:.3g} Hz)"


_KNOWN = {
    r"Panda\w+-v3": EpisodeTime(50, 0.04),
    r"(Hopper|HalfCheetah|Walker2D|Ant)BulletEnv-v0": EpisodeTime(1000, 0.0165),
    r"LunarLanderContinuous-v3": EpisodeTime(1000, 0.02),
    r"BipedalWalker-v3": EpisodeTime(1600, 0.02),
    r"BipedalWalkerHardcore-v3": EpisodeTime(2000, 0.02),
}


def episode_time(environment_id: str) -> EpisodeTime | None:
    """Of an environment of the paper in which time is seconds; None of others."""
    return next((time for pattern, time in _KNOWN.items() if re.fullmatch(pattern, environment_id)), None)
