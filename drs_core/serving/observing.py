"""The observation that panda-gym would give, made of what an arm measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.panda import BASE_FROM_WORLD_M

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_MIN_INTERVAL_S = 1e-6
_NEARLY_VERTICAL = 0.99999


@dataclass(frozen=True)
class Task:
    """What a panda-gym environment observes besides tip and goal.

    Attributes:
        has_object: pose and velocity of an object, whose position is what is achieved.
        has_gripper: the width of the fingers, and an action for them.
    """

    has_object: bool = False
    has_gripper: bool = False

    @property
    def actions(self) -> int:
        """Length of an action."""
        return 4 if self.has_gripper else 3


TASKS = {
    "PandaReach-v3": Task(),
    "PandaPush-v3": Task(has_object=True),
    "PandaSlide-v3": Task(has_object=True),
    "PandaPickAndPlace-v3": Task(has_object=True, has_gripper=True),
}


def task_of(environment: str) -> Task:
    """The task of an environment.

    Raises:
        UsageError: its observation cannot be made of an arm's measurements.
    """
    if environment not in TASKS:
        raise UsageError(f"The environment {environment} cannot be served to an arm; known are {', '.join(TASKS)}.")
    return TASKS[environment]


def observation(
    task: Task,
    tip: Float64,
    tip_velocity: Float64,
    goal: Float64,
    finger_width_m: float = 0.0,
    object_position: Float64 | None = None,
    object_orientation: Sequence[float] | Float64 = (0.0, 0.0, 0.0, 1.0),
    object_velocity: Float64 | None = None,
) -> dict[str, Float32]:
    """The parts of panda-gym's observation, float32 as there.

    Args:
        task: which parts there are.
        tip: (3,) [m] in the frame of the base; the observation is in panda-gym's world, whose x is 0.6 m less.
        tip_velocity: (3,) [m/s].
        goal: (3,) [m] in the frame of the base.
        finger_width_m: both fingers together.
        object_position: (3,) [m] in the frame of the base.
        object_orientation: (4,) x, y, z, w; observed as roll, pitch, yaw.
        object_velocity: (6,) linear, then angular [m/s, rad/s].
    """
    achieved = (tip - BASE_FROM_WORLD_M).tolist()
    seen = achieved + tip_velocity.tolist()
    if task.has_gripper:
        seen.append(finger_width_m)
    if task.has_object:
        if object_position is None or object_velocity is None:
            raise ValueError("a task with an object needs its position and velocity")
        achieved = (object_position - BASE_FROM_WORLD_M).tolist()
        seen += achieved + euler_angles(object_orientation).tolist() + object_velocity.tolist()
    return {
        "achieved_goal": np.array(achieved, np.float32),
        "desired_goal": np.array((goal - BASE_FROM_WORLD_M).tolist(), np.float32),
        "observation": np.array(seen, np.float32),
    }


def euler_angles(orientation: Sequence[float] | Float64) -> Float64:
    """Roll, pitch, yaw [rad] of a quaternion x, y, z, w, as PyBullet's getEulerFromQuaternion."""
    x, y, z, w = (float(value) for value in orientation)
    sine = -2.0 * (x * z - w * y)
    # the two ends of pitch, where roll and yaw turn about the same axis
    if sine <= -_NEARLY_VERTICAL:
        return np.array([0.0, -0.5 * math.pi, 2.0 * math.atan2(x, -y)])
    if sine >= _NEARLY_VERTICAL:
        return np.array([0.0, 0.5 * math.pi, 2.0 * math.atan2(-x, y)])
    roll = math.atan2(2.0 * (y * z + w * x), w * w - x * x - y * y + z * z)
    yaw = math.atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z)
    return np.array([roll, math.asin(sine), yaw])


class Differentiator:
    """Velocity of a pose from two consecutive ones.

    The mean velocity in between, which lags the present one by half an interval: the error is at
    most half the acceleration times the interval.
    """

    def __init__(self) -> None:
        """Begin without a pose."""
        self._last: tuple[float, Float64, Float64] | None = None

    def update(self, stamp_s: float, position: Float64, orientation: Float64) -> Float64 | None:
        """Velocity (6,) linear, then angular [m/s, rad/s]; None for the first pose and for one that is no later."""
        last, self._last = self._last, (stamp_s, position, orientation)
        if last is None or not stamp_s - last[0] >= _MIN_INTERVAL_S:
            return None
        interval = stamp_s - last[0]
        return np.concatenate((position - last[1], _rotation_between(last[2], orientation))) / interval


def _rotation_between(before: Float64, after: Float64) -> Float64:
    """Rotation vector (3,) [rad], in the common frame, of the shorter way from one quaternion to another."""
    # after times the conjugate of before
    vector: Float64 = before[3] * after[:3] - after[3] * before[:3] - np.cross(after[:3], before[:3])
    scalar = float(after @ before)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        return np.zeros(3)
    angle = 2.0 * math.atan2(length, abs(scalar))
    return vector * (math.copysign(angle, scalar) / length)
