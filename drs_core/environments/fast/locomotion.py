"""One step of Hopper, HalfCheetah, Walker2D and Ant in seven or eight calls of PyBullet instead of 23 to 47.

The formulas are those of ``WalkerBaseBulletEnv.step`` and ``WalkerBase.calc_state`` of
pybullet-envs-gymnasium, with the same operations in the same order: where upstream rounds to
float32, so does this, and where numpy could take another path than Python's libm or BLAS
(sine, cosine, arctangent, dot products), numpy is asked too.

Everything that lasts from step to step stays in upstream's own objects, so that upstream's reset,
rendering and step can take over at any moment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from operator import mul
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from drs_core.environments.fast.float32 import least_above, mean_float32, pairwise_sum

Taken = tuple[Any, float, bool, bool, Mapping[str, Any]]

_FLOAT32 = np.dtype(np.float32)
_AT_LIMIT = least_above(0.99)
_HIGHEST = 5.0
"""Observations are clipped to +-5."""


def stepper(env: Any) -> Callable[[NDArray[Any]], Taken]:
    """A fast ``env.step`` for a bare environment that has been reset once."""
    return _Locomotion(env).step


class _Locomotion:
    def __init__(self, env: Any) -> None:
        self._env, self._robot, self._client = env, env.robot, env.physicsClientId
        robot = self._robot
        torso = robot.robot_body
        self._body: int = torso.bodies[torso.bodyIndex]
        self._torso: int = torso.bodyPartIndex
        self._joints = [joint.jointIndex for joint in robot.ordered_joints]
        self._scales = [(joint.lowerLimit, joint.upperLimit - joint.lowerLimit) for joint in robot.ordered_joints]
        self._gains = [robot.power * joint.power_coef for joint in robot.ordered_joints]
        self._feet = [foot.bodyPartIndex for foot in robot.feet]
        ((self._floor, _),) = env.ground_ids
        parts = [(part.bodies[part.bodyIndex], part.bodyPartIndex) for part in robot.parts.values()]
        self._links = [link for body, link in parts if body == self._body and link >= 0]
        # the floor, and the torso where it is the base, are no links
        self._others = [
            (place, body == self._body) for place, (body, link) in enumerate(parts) if body != self._body or link < 0
        ]
        # the floor never moves
        self._floor_xyz, _ = pybullet.getBasePositionAndOrientation(self._floor, self._client)
        self._rotation, self._velocity, self._turned = np.eye(3), np.empty(3), np.empty(3)
        self._to_target = np.empty(2)

    def step(self, action: NDArray[Any]) -> Taken:
        """Take one step; action (n_actions,) float32."""
        efforts = action.tolist()
        if action.dtype != _FLOAT32 or len(efforts) != len(self._gains) or not math.isfinite(sum(efforts)):
            taken: Taken = self._env.step(action)
            return taken
        torques = [
            gain * (1.0 if effort > 1.0 else -1.0 if effort < -1.0 else effort)
            for gain, effort in zip(self._gains, efforts)
        ]
        pybullet.setJointMotorControlArray(
            self._body, self._joints, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=self._client
        )
        pybullet.stepSimulation(self._client)
        values = self._pose()
        values += self._joint_values()
        values += self._robot.feet_contact.tolist()
        if not math.isfinite(sum(values)):
            return self._upstream(action)
        observation = np.array(values, dtype=np.float32)
        rounded, joints = observation.tolist(), slice(9, 8 + 2 * len(efforts), 2)
        self._robot.joint_speeds = observation[joints].copy()
        if max(rounded) > _HIGHEST or min(rounded) < -_HIGHEST:
            observation.clip(-_HIGHEST, _HIGHEST, out=observation)
        reward, ended = self._judge(efforts, observation.item(0), rounded[joints])
        return observation, reward, ended, False, {}

    def _pose(self) -> list[float]:
        """Eight numbers: height, direction to the target, velocity of the torso, roll and pitch."""
        robot, client, torso = self._robot, self._client, self._torso
        states = pybullet.getLinkStates(self._body, self._links, physicsClientId=client)
        if torso < 0:
            torso_xyz, quaternion = pybullet.getBasePositionAndOrientation(self._body, client)
            speed, _ = pybullet.getBaseVelocity(self._body, client)
        else:
            state = pybullet.getLinkState(self._body, torso, 1, physicsClientId=client)
            torso_xyz, quaternion, speed = state[0], state[1], state[6]
        at = [state[0] for state in states]
        for place, is_torso in self._others:
            at.insert(place, torso_xyz if is_torso else self._floor_xyz)
        count = len(at)
        x, y = pairwise_sum([place[0] for place in at]) / count, pairwise_sum([place[1] for place in at]) / count
        z = torso_xyz[2]
        roll, pitch, yaw = angles = pybullet.getEulerFromQuaternion(quaternion)
        pair = self._to_target
        pair[0] = dy = robot.walk_target_y - y
        pair[1] = dx = robot.walk_target_x - x
        theta = np.arctan2(dy, dx)
        robot.body_xyz, robot.body_real_xyz, robot.body_rpy = (x, y, z), torso_xyz, angles
        robot.walk_target_theta, robot.walk_target_dist = theta, math.sqrt(pair.dot(pair))
        to_target = theta - yaw
        rotation, cosine, sine = self._rotation, np.cos(-yaw), np.sin(-yaw)
        rotation[0, 0] = rotation[1, 1] = cosine
        rotation[0, 1], rotation[1, 0] = -sine, sine
        self._velocity[:] = speed
        vx, vy, vz = rotation.dot(self._velocity, self._turned).tolist()
        return [
            z - robot.initial_z, np.sin(to_target), np.cos(to_target), 0.3 * vx, 0.3 * vy, 0.3 * vz, roll, pitch
        ]  # fmt: skip

    def _joint_values(self) -> list[float]:
        """Position between its limits, and a tenth of the velocity, of every joint in turn."""
        values: list[float] = []
        at_limit = 0
        states = pybullet.getJointStates(self._body, self._joints, self._client)
        for (low, span), (position, velocity, _, _) in zip(self._scales, states):
            scaled = 2 * (position - low) / span - 1.0
            values += (scaled, 0.1 * velocity)
            if not -_AT_LIMIT < scaled < _AT_LIMIT:
                at_limit += 1
        self._robot.joints_at_limit = at_limit
        return values

    def _judge(self, efforts: list[float], height: float, speeds: list[float]) -> tuple[float, bool]:
        """Reward, and whether the episode ends."""
        env, robot = self._env, self._robot
        env._alive = alive = float(robot.alive_bonus(height + robot.initial_z, robot.body_rpy[1]))
        potential = -robot.walk_target_dist / env.scene.dt
        progress = float(potential - env.potential)
        env.potential = potential
        self._feel_the_floor()
        electricity = env.electricity_cost * mean_float32([abs(value) for value in map(mul, efforts, speeds)])
        electricity += env.stall_torque_cost * mean_float32([value * value for value in efforts])
        env.rewards = [alive, progress, electricity, env.joints_at_limit_cost * robot.joints_at_limit, 0.0]
        reward = sum(env.rewards)
        env.reward += reward
        return reward, bool(env._isDone())

    def _feel_the_floor(self) -> None:
        contact = self._robot.feet_contact
        points = pybullet.getContactPoints(self._body, self._floor, physicsClientId=self._client)
        touching = {point[3] for point in points}
        for index, foot in enumerate(self._feet):
            contact[index] = foot in touching

    def _upstream(self, action: NDArray[Any]) -> Taken:
        """What upstream makes of a state that is not finite; the simulation has already moved on."""
        scene = self._env.scene
        scene.multiplayer = True  # upstream's word for: someone else applies the action and steps
        try:
            taken: Taken = self._env.step(action)
        finally:
            del scene.multiplayer
        return taken
