"""How long an environment's episodes last on the robot that it stands for."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from typing import Any

from drs_core.environments.catalogue import current_name, entry
from drs_core.environments.environment import Environment
from drs_core.errors import UsageError, shown

HIGHEST_RATE_HZ = 100_000.0


@dataclass(frozen=True)
class Timing:
    """Clock of an environment.

    Attributes:
        period_s: time between two actions [s].
        limit_steps: an episode's greatest length.
    """

    period_s: float
    limit_steps: int

    @property
    def episode_s(self) -> float:
        """The longest that an episode can last [s]."""
        return self.period_s * self.limit_steps

    def __str__(self) -> str:
        """The longest episode in words."""
        return f"{self.episode_s:.3g} s ({self.limit_steps} steps at {1 / self.period_s:.3g} Hz)"


def known_timing(environment_id: str) -> Timing | None:
    """The clock of an environment of the paper, without making it; None of any other."""
    known = entry(current_name(environment_id))
    if known.period_s is None or known.limit_steps is None:
        return None
    return Timing(known.period_s, known.limit_steps)


def timing(environment_id: str) -> Timing:
    """The clock of an environment; the twelve of the paper are known, any other is made once to look at it.

    Of the others the rate is gymnasium's `render_fps`, which is meant to be one frame a step.

    Raises:
        UsageError: the id is unknown, or it states no rate.
        DrsError: the package that it needs is not installed.
    """
    known = known_timing(environment_id)
    if known is not None:
        return known
    with closing(Environment(environment_id, fast=False)) as environment:
        rate_hz = environment.unwrapped.metadata.get("render_fps")
        if not _is_rate(rate_hz):
            raise UsageError(
                f"{environment.id} states no control rate (its render_fps is {shown(rate_hz)}), so time cannot be "
                "turned into rollouts; give the number of updates instead."
            )
        return Timing(1.0 / rate_hz, environment.spaces.time_limit_steps)


def _is_rate(value: Any) -> bool:
    try:
        return not isinstance(value, bool) and bool(0.0 < value <= HIGHEST_RATE_HZ)
    except (TypeError, ValueError):
        return False
