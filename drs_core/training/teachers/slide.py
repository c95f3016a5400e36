"""A controller for PandaSlide: one strike of the closed fingers that sends the puck to the goal.

Puck and fingers are elastic, and within a control period of 40 ms an approach at speed meets the puck at
any phase: the same action then gives speeds from 0.1 to 0.7 m/s. So the fingers come nearly to rest a
centimetre behind the puck first, from where one action strikes within one period and gives one speed, to
0.02 m/s, also where they are some millimetres nearer or farther. They go forward along x, flat
in front, and hit with an edge where the way to the goal is aslant.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.panda import TIP_STEP_M
from drs_core.training.teachers.actions import limited

# measured on the table: a puck at 0.5 m/s loses 0.0088 m/s a step
_DECELERATION = 0.22
# what an episode leaves of its 2 s once the fingers are there
_TIME_LEFT_S = 1.7
# measured: direction of the struck puck, degrees, against the distance beside its centre, m
_DIRECTIONS_DEG = (0.0, 1.5, 5.0, 8.0, 11.0, 14.0, 17.5, 22.0, 30.0)
_BESIDE_M = (0.0, 0.02, 0.022, 0.024, 0.026, 0.028, 0.03, 0.033, 0.036)
# from tip to puck's centre; touching is 0.038
_NEAR_M, _READY_M, _FAR_M = 0.044, 0.05, 0.058
_CROSSES_M = 0.042, 0.06
_PUCK_RADIUS_M, _WIDEST_DEG = 0.03, 20.0
_LOW_M, _OVER_PUCK_M, _AWAY_M = 0.02, 0.07, 0.08
_STILL, _SLIDING = 0.08, 0.03
# the arm does not strike a puck beyond
_REACH_X_M = 0.25


def slide(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Action (3,) in [-1, 1] for one observation: displacement of the tip."""
    state = observation["observation"].astype(np.float64)
    tip, tip_velocity, puck, velocity = state[:3], state[3:6], state[6:9], state[12:14]
    if np.linalg.norm(velocity) > _SLIDING or puck[0] > _REACH_X_M:
        return limited(-0.3, 0.0, (_AWAY_M - tip[2]) / TIP_STEP_M)
    wanted = _arriving(observation["desired_goal"][:2] - puck[:2])
    angle = float(np.degrees(np.arctan2(wanted[1], wanted[0])))
    behind, down = puck[0] - tip[0], _LOW_M - tip[2]
    aside = puck[1] - np.sign(angle) * np.interp(abs(angle), _DIRECTIONS_DEG, _BESIDE_M) - tip[1]
    # an edge meets the puck where it is narrower
    gap = behind + _PUCK_RADIUS_M * (1.0 - np.cos(np.radians(min(abs(angle), _WIDEST_DEG))))
    ready = abs(down) < 0.01 and abs(aside) < 0.004 and np.linalg.norm(tip_velocity) < _STILL
    forward = _strike(float(np.linalg.norm(wanted)), float(puck[0]), angle, float(gap))
    if ready and _NEAR_M < gap < _FAR_M and forward <= 1.0:
        return limited(forward, aside / TIP_STEP_M, down / TIP_STEP_M)
    # over the puck, not through it, where the way to behind it leads there
    if behind < _CROSSES_M[0] and abs(aside) < _CROSSES_M[1]:
        down = _OVER_PUCK_M - tip[2]
    way = (gap - _READY_M, aside, down)
    return limited(*(part / TIP_STEP_M for part in way))


def _strike(speed: float, x: float, angle: float, gap: float) -> float:
    """The action forward that gives a puck at `x` this speed [m/s]: least squares of 247 strikes, error 0.015."""
    aslant = (min(abs(angle), 30.0) / 30.0) ** 2
    return 0.112 + 0.83 * speed + 0.88 * x + 3.0 * x**2 + 0.1 * aslant + 22.0 * (gap - 0.048)


def _arriving(way: NDArray[Any]) -> NDArray[np.float64]:
    """Velocity [m/s] of a puck that comes to rest after `way` [m], or is there when the time is over."""
    distance = max(float(np.linalg.norm(way)), 1e-9)
    speed = float(np.sqrt(2.0 * _DECELERATION * distance))
    if speed / _DECELERATION > _TIME_LEFT_S:
        speed = distance / _TIME_LEFT_S + _DECELERATION * _TIME_LEFT_S / 2.0
    direction: NDArray[np.float64] = np.asarray(way, np.float64) / distance
    return direction * speed
