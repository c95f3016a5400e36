"""One step of Panda Reach, Push, Slide and PickAndPlace with every state read once.

The formulas are those of ``RobotTaskEnv.step``, ``Panda.set_action`` and the tasks of panda-gym,
with the same operations in the same order. Nothing lasts from step to step here: positions are
read where upstream reads them, so that commands, resets and upstream's own step may come between.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping
from operator import sub
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

Taken = tuple[Any, float, bool, bool, Mapping[str, Any]]

_FLOAT32 = np.dtype(np.float32)
_HAND_DOWN = (1.0, 0.0, 0.0, 0.0)
_STEP_M = float(np.float32(0.05))
_WIDTH_STEP_M = 0.2


def stepper(env: Any) -> Callable[[NDArray[Any]], Taken]:
    """A fast ``env.step`` for a bare environment with displacement control and sparse reward."""
    return _Panda(env).step


class _Panda:
    def __init__(self, env: Any) -> None:
        robot, sim = env.robot, env.sim
        self._robot, self._task, self._client = robot, env.task, sim.physics_client._client
        self._body: int = sim._bodies_idx[robot.body_name]
        self._object: int | None = sim._bodies_idx.get("object")
        self._tip: int = robot.ee_link
        self._joints, self._forces = robot.joint_indices.tolist(), robot.joint_forces.tolist()
        self._fingers = None if robot.block_gripper else robot.fingers_indices.tolist()
        (self._size,) = robot.action_space.shape
        self._substeps = range(sim.n_substeps)

    def step(self, action: NDArray[Any]) -> Taken:
        """Take one step; action (n_actions,) float32, or targets where a command interface takes them."""
        robot, client = self._robot, self._client
        wishes = action.tolist()
        if "set_action" in vars(robot) or action.dtype != _FLOAT32 or len(wishes) != self._size:
            robot.set_action(action)
        elif not math.isfinite(sum(wishes)):
            robot.set_action(action)
        else:
            self._command([1.0 if wish > 1.0 else -1.0 if wish < -1.0 else wish for wish in wishes])
        step_simulation = pybullet.stepSimulation
        for _ in self._substeps:
            step_simulation(client)
        return self._observe()

    def _command(self, action: list[float]) -> None:
        body, client = self._body, self._client
        # upstream's product of float32 numbers: exact in float64, then rounded
        dx, dy, dz = array("f", [wish * _STEP_M for wish in action[:3]])
        x, y, z = pybullet.getLinkState(body, self._tip, physicsClientId=client)[0]
        target = (x + dx, y + dy, max(0.0, z + dz))
        angles = pybullet.calculateInverseKinematics(body, self._tip, target, _HAND_DOWN, physicsClientId=client)
        # numpy's product and sum: which of them are float32 depends on its version
        width = 0.0 if self._fingers is None else self._width() + np.float32(action[-1]) * _WIDTH_STEP_M
        pybullet.setJointMotorControlArray(
            body, self._joints, pybullet.POSITION_CONTROL,
            targetPositions=(*angles[:7], width / 2, width / 2), forces=self._forces, physicsClientId=client,
        )  # fmt: skip

    def _observe(self) -> Taken:
        client = self._client
        tip = pybullet.getLinkState(self._body, self._tip, 1, physicsClientId=client)
        values = [*tip[0], *tip[6]]
        if self._fingers is not None:
            values.append(self._width())
        place = tip[0]
        if self._object is not None:
            place, quaternion = pybullet.getBasePositionAndOrientation(self._object, client)
            speed, spin = pybullet.getBaseVelocity(self._object, client)
            values += (*place, *pybullet.getEulerFromQuaternion(quaternion), *speed, *spin)
        # the goal is compared with float32 numbers
        achieved, goal = array("f", place), self._task.goal
        observation = {
            "achieved_goal": np.array(achieved),
            "desired_goal": goal.astype(np.float32),
            "observation": np.array(values, dtype=np.float32),
        }
        # numpy's norm of three numbers; -0.0 is upstream's reward at the goal
        x, y, z = map(sub, achieved, goal.tolist())
        distance, threshold = math.sqrt(x * x + y * y + z * z), self._task.distance_threshold
        reached = distance < threshold
        return observation, -1.0 if distance > threshold else -0.0, reached, False, {"is_success": reached}

    def _width(self) -> float:
        left, right = pybullet.getJointStates(self._body, self._fingers, self._client)
        return float(left[0] + right[0])
