"""A controller for PandaPush: behind the cube, then forward until it will come to rest at the goal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.measures.smoothness import CONTROL_PERIOD_S
from drs_core.panda import TIP_STEP_M
from drs_core.training.teachers.actions import limited

# measured on the table: a cube at 0.4 m/s loses 0.09 m/s a step
_DECELERATION = 2.3
_NEAR_M = 0.02
_GAIN, _SPEED = 0.5, 0.45
_RUN_UP_M, _TOUCHING_M, _ALIGNED_M = 0.055, 0.02, 0.015
_LOW_M, _LOW_ENOUGH_M, _HALF_WAY_M, _OVER_CUBE_M, _CLEAR_M = 0.02, 0.035, 0.06, 0.08, 0.05


def push(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Action (3,) in [-1, 1] for one observation: displacement of the tip."""
    state = observation["observation"].astype(np.float64)
    tip, cube, velocity = state[:3], state[6:8], state[12:14]
    rest = cube + velocity * np.linalg.norm(velocity) / (2.0 * _DECELERATION)
    way = observation["desired_goal"][:2] - rest
    distance = float(np.linalg.norm(way))
    if distance < _NEAR_M:
        return np.zeros(3)
    forward = way / distance
    cube = cube + velocity * CONTROL_PERIOD_S
    sideways = np.array([-forward[1], forward[0]])
    ahead, aside = float((tip[:2] - cube) @ forward), float((tip[:2] - cube) @ sideways)
    if ahead < -_TOUCHING_M and abs(aside) < _ALIGNED_M and tip[2] < _LOW_ENOUGH_M:
        speed = min(_SPEED, _GAIN * distance / TIP_STEP_M)
        return limited(*(forward * speed - sideways * aside / TIP_STEP_M), (_LOW_M - tip[2]) / TIP_STEP_M)
    behind = cube - forward * _RUN_UP_M - tip[:2]
    # up, and over the cube, where it stands between the tip and the place behind it
    if ahead > -0.035 and abs(aside) < 0.05:
        level = behind / TIP_STEP_M if tip[2] > _CLEAR_M else np.zeros(2)
        return limited(*level, (_OVER_CUBE_M - tip[2]) / TIP_STEP_M)
    low = np.linalg.norm(behind) < 0.03 or ahead < -0.045
    return limited(*(behind / TIP_STEP_M), ((_LOW_M if low else _HALF_WAY_M) - tip[2]) / TIP_STEP_M)
