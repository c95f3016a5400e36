"""What the helper must know of a robot: read from upstream's objects, and a table of its rules."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.accelerator.library import Robot, Unavailable, float64, int32, pointer

_STANDS = -2
"""Link number of a part that is not of the robot and never moves: the floor."""


@dataclass(frozen=True)
class Rules:
    """When a robot is alive (pybullet_envs_gymnasium, robot_locomotors.py, alive_bonus).

    Attributes:
        least_height_m: of the torso; 0: not looked at.
        greatest_pitch_rad: either way; 0: not looked at.
        bruising: which of the feet must not touch the floor.
        falls: whether the episode ends when it is not alive.
    """

    least_height_m: float = 0.0
    greatest_pitch_rad: float = 0.0
    bruising: tuple[int, ...] = ()
    falls: bool = True


RULES = {
    "HopperBulletEnv-v0": Rules(0.8, 1.0),
    "Walker2DBulletEnv-v0": Rules(0.8, 1.0),
    "HalfCheetahBulletEnv-v0": Rules(0.0, 1.0, (1, 2, 4, 5), falls=False),
    "AntBulletEnv-v0": Rules(0.26),
}


class RobotData:
    """The structure `Robot` of an environment that has been reset, and the arrays that it points to."""

    def __init__(self, environment_id: str, env: Any) -> None:
        """Read upstream's unwrapped environment.

        Raises:
            Unavailable: it is not one of the four.
        """
        if environment_id not in RULES:
            raise Unavailable(f"it runs {', '.join(RULES)} only, not {environment_id}")
        rules, robot, p = RULES[environment_id], env.robot, env._p
        body = robot.objects[0]
        # Bullet's own numbering: the helper's client has not seen the robot being loaded
        info = [p.getJointInfo(body, joint.jointIndex) for joint in robot.ordered_joints]
        parts = [_place(part) for part in robot.parts.values()]
        fixed = [part.current_position()[:2] for part in robot.parts.values()]
        floor = next(iter(env.ground_ids))
        self.n_joints, self.n_feet = len(info), len(robot.feet)
        self._arrays: dict[str, NDArray[Any]] = {
            "joint_q": int32([row[3] for row in info]),
            "joint_u": int32([row[4] for row in info]),
            "part_link": int32([link if of == body else _STANDS for of, link in parts]),
            "foot_link": int32([_place(foot)[1] for foot in robot.feet]),
            "bruising": int32(rules.bruising),
            "joint_low": float64([joint.lowerLimit for joint in robot.ordered_joints]),
            "joint_high": float64([joint.upperLimit for joint in robot.ordered_joints]),
            "joint_gain": float64([robot.power * joint.power_coef for joint in robot.ordered_joints]),
            "fixed": float64(fixed),
        }
        self.structure = Robot(
            body=body,
            floor_body=floor[0],
            torso_link=_place(robot.robot_body)[1],
            n_joints=self.n_joints,
            n_parts=len(parts),
            n_feet=self.n_feet,
            n_bruising=len(rules.bruising),
            falls=rules.falls,
            fused=numpy_fuses(),
            least_height=rules.least_height_m,
            greatest_pitch=rules.greatest_pitch_rad,
            target_x=robot.walk_target_x,
            target_y=robot.walk_target_y,
            dt=env.scene.dt,
            electricity_cost=env.electricity_cost,
            stall_torque_cost=env.stall_torque_cost,
            limit_cost=env.joints_at_limit_cost,
            **{name: pointer(array) for name, array in self._arrays.items()},
        )

    @property
    def n_observation(self) -> int:
        """Numbers of an observation: 8 of the body, 2 a joint, 1 a foot."""
        return 8 + 2 * self.n_joints + self.n_feet


@cache
def numpy_fuses() -> bool:
    """Whether numpy's norm of (y, x) is that of fma(x, x, y * y) here; it depends on the BLAS kernel.

    Raises:
        Unavailable: it is neither that nor that of y * y + x * x.
    """
    pairs = np.random.default_rng(0).uniform(-10.0, 1000.0, (200, 2)).tolist()
    norms = [float(np.linalg.norm(pair)) for pair in pairs]
    if norms == [math.sqrt(y * y + x * x) for y, x in pairs]:
        return False
    if norms == [math.sqrt(Fraction(x) * Fraction(x) + Fraction(y * y)) for y, x in pairs]:
        return True
    raise Unavailable("numpy's norm rounds in a way that it does not know; another build of numpy may mend it")


def _place(part: Any) -> tuple[int, int]:
    return part.bodies[part.bodyIndex], part.bodyPartIndex
