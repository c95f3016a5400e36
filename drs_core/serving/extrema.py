"""How far a planned joint goes.

Ruckig's own `position_extrema` leaves out turning points (pantor/ruckig, issue 215), so they are
computed here from the phases of constant jerk.
"""

from __future__ import annotations

import math
from typing import Any


def profile_extrema(profile: Any) -> tuple[float, float]:
    """Lowest and highest position on the way of one joint, from a `ruckig.Profile`."""
    low = high = profile.p[-1]
    for part in (profile.brake, profile, profile.accel):
        for duration, jerk, acceleration, velocity, position in zip(part.t, part.j, part.a, part.v, part.p):
            if duration > 0.0:
                for place in _turning_points(duration, jerk, acceleration, velocity, position):
                    low, high = min(low, place), max(high, place)
    return low, high


def _turning_points(t: float, j: float, a: float, v: float, p: float) -> list[float]:
    """Positions at the ends of a phase of constant jerk, and where it turns round in between."""
    places = [p, _at(t, j, a, v, p)]
    # v + a s + j s^2 / 2 = 0, solved so that neither root loses digits
    half = 0.5 * j
    root = a * a - 4.0 * half * v
    if root < 0.0:
        return places
    q = -0.5 * (a + math.copysign(math.sqrt(root), a))
    for numerator, denominator in ((q, half), (v, q)):
        if denominator != 0.0:
            s = numerator / denominator
            if 0.0 < s < t:
                places.append(_at(s, j, a, v, p))
    return places


def _at(s: float, j: float, a: float, v: float, p: float) -> float:
    return p + s * (v + s * (a / 2.0 + s * j / 6.0))
