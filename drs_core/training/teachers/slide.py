"""A controller for PandaSlide: taps of the closed fingers that send the puck towards the goal.

Puck and fingers are elastic and nearly without friction: a tap changes the puck's velocity along the
normal of the contact. The fingers' front is flat in y and has two edges, so that the normal is chosen
by how far beside the puck's centre the fingers go forward.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.measures.smoothness import CONTROL_PERIOD_S
from drs_core.panda import TIP_STEP_M
from drs_core.training.teachers.actions import limited

# measured on the table: a puck at 0.5 m/s loses 0.0088 m/s a step
_DECELERATION = 0.22
# measured: direction of the puck after a tap, degrees, against the distance beside its centre, m
_DIRECTIONS_DEG = (0.0, 3.0, 19.0, 42.0, 60.0)
_BESIDE_M = (0.0, 0.02, 0.03, 0.04, 0.045)
# measured: full action moves the tip at 0.5 m/s near the table; a tap gives the puck more than that
_FULL_SPEED, _TAP_GAIN = 0.5, 0.4
_GOOD_ENOUGH = 0.04
_RUN_UP_M, _TOUCHING_M, _ALIGNED_M = 0.075, 0.035, 0.006
_LOW_M, _LOW_ENOUGH_M, _OVER_PUCK_M, _AWAY_M = 0.02, 0.035, 0.07, 0.08
# the arm does not reach, or not catch up with, a puck beyond these
_REACH_X_M, _BEHIND_M = 0.22, 0.16


def slide(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Action (3,) in [-1, 1] for one observation: displacement of the tip."""
    state = observation["observation"].astype(np.float64)
    tip, puck, velocity = state[:3], state[6:9], state[12:14]
    missing = _stopping_at(observation["desired_goal"][:2] - puck[:2]) - velocity
    moving = np.linalg.norm(velocity) > 0.03
    if (
        np.linalg.norm(missing) < _GOOD_ENOUGH
        or missing[0] < 0.02
        or puck[0] > _REACH_X_M
        or (moving and puck[0] - tip[0] > _BEHIND_M)
    ):
        return limited(-0.3, 0.0, (_AWAY_M - tip[2]) / TIP_STEP_M)
    x, y = puck[:2] + velocity * CONTROL_PERIOD_S
    behind, aside = x - tip[0], y + _beside(missing) - tip[1]
    if behind > _TOUCHING_M and abs(aside) < _ALIGNED_M and tip[2] < _LOW_ENOUGH_M:
        forward = (velocity[0] + _TAP_GAIN * np.linalg.norm(missing)) / _FULL_SPEED
        return limited(forward, aside / TIP_STEP_M, (_LOW_M - tip[2]) / TIP_STEP_M)
    # over the puck, not through it, where the way to behind it leads there
    crosses = behind < 0.045 and abs(aside) < 0.06
    way = (behind - _RUN_UP_M, aside, (_OVER_PUCK_M if crosses else _LOW_M) - tip[2])
    return limited(*(part / TIP_STEP_M for part in way))


def _stopping_at(way: NDArray[Any]) -> NDArray[np.float64]:
    """Velocity, m/s, of a puck that comes to rest after `way`, m: v^2 = 2 a s."""
    distance = max(float(np.linalg.norm(way)), 1e-9)
    direction: NDArray[np.float64] = np.asarray(way, np.float64) / distance
    return direction * float(np.sqrt(2.0 * _DECELERATION * distance))


def _beside(missing: NDArray[np.float64]) -> float:
    """Where the fingers go forward, m beside the puck's centre, so that the tap gives this direction."""
    angle = np.degrees(np.arctan2(missing[1], missing[0]))
    return float(-np.sign(angle) * np.interp(abs(angle), _DIRECTIONS_DEG, _BESIDE_M))
