"""A controller for PandaPickAndPlace: over the cube, down, grasp, carry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.panda import TIP_STEP_M
from drs_core.training.teachers.actions import limited

_ABOVE_M = 0.055
# fingers around the 4 cm cube are narrower than this, m
_HOLDING_WIDTH_M = 0.05
_HELD_M = 0.025
_OVER_IT_M = 0.02
_AROUND_IT_M = 0.012
_CARRYING_GAIN = 0.8
_OPEN, _CLOSE = 1.0, -1.0


def pick_and_place(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Action (4,) in [-1, 1] for one observation: displacement of the tip, and the fingers."""
    tip, width = observation["observation"][:3], observation["observation"][6]
    cube, goal = observation["achieved_goal"], observation["desired_goal"]
    to_cube = (cube - tip).astype(np.float64)
    beside = np.linalg.norm(to_cube[:2])
    if np.linalg.norm(to_cube) < _HELD_M and width < _HOLDING_WIDTH_M:
        move, fingers = _straight(_CARRYING_GAIN * (goal - cube)), _CLOSE
    elif beside < _AROUND_IT_M and abs(to_cube[2]) < _AROUND_IT_M:
        move, fingers = _straight(to_cube), _CLOSE
    elif beside < _OVER_IT_M:
        move, fingers = _straight(to_cube), _OPEN
    else:
        over_it = to_cube + np.array([0.0, 0.0, _ABOVE_M])
        move, fingers = limited(*(over_it / TIP_STEP_M)), _OPEN
    return np.append(move, fingers)


def _straight(way: NDArray[Any]) -> NDArray[np.float64]:
    """The action (3,) that moves the tip along `way`, m, without bending it where it is long."""
    move = np.asarray(way, np.float64) / TIP_STEP_M
    return move / max(1.0, float(np.abs(move).max()))
