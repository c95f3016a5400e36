"""What an environment's robot is doing, in SI units; commands that go below the action (Panda)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.environments.environment import Environment
from drs_core.errors import UsageError
from drs_core.panda import ARM_JOINTS, BASE_FROM_WORLD_M, FINGER_JOINTS, FINGER_STEP_M, TIP_ORIENTATION, tip_target

Float64 = NDArray[np.float64]

_DEFAULT_PERIOD_S = 1.0 / 30.0


@dataclass(frozen=True)
class RobotState:
    """A robot at one moment; positions are in the frame of its base.

    Attributes:
        joints: names.
        positions, velocities: (joints,) in rad or m, and per second.
        tip_position, tip_velocity, tip_angular_velocity: (3,) in m, m/s and rad/s; None without a tip.
        tip_orientation: (4,) x, y, z, w.
        goal_position: (3,) in m; None without a goal.
    """

    joints: tuple[str, ...]
    positions: Float64
    velocities: Float64
    tip_position: Float64 | None = None
    tip_orientation: Float64 | None = None
    tip_velocity: Float64 | None = None
    tip_angular_velocity: Float64 | None = None
    goal_position: Float64 | None = None


def period_s(environment: Environment) -> float:
    """Simulated time of one step [s]."""
    env = environment.unwrapped
    if environment.id.startswith("Panda"):
        return float(env.sim.dt)
    scene = getattr(env, "scene", None)
    if scene is not None:
        return float(scene.dt)
    rate = getattr(env, "metadata", {}).get("render_fps")
    return 1.0 / rate if rate else _DEFAULT_PERIOD_S


def read_state(environment: Environment) -> RobotState | None:
    """The robot's state; None where the environment has no jointed robot that can be read."""
    env = environment.unwrapped
    if environment.id.startswith("Panda"):
        return _panda(env)
    joints = getattr(getattr(env, "robot", None), "ordered_joints", None)
    if not joints:
        return None
    states = np.array([joint.get_state() for joint in joints], dtype=np.float64)
    return RobotState(tuple(joint.joint_name for joint in joints), states[:, 0], states[:, 1])


def _panda(env: Any) -> RobotState:
    robot, sim = env.robot, env.sim
    body = sim._bodies_idx[robot.body_name]
    states = sim.physics_client.getJointStates(body, [int(index) for index in robot.joint_indices])
    goal = env.task.get_goal()
    return RobotState(
        joints=ARM_JOINTS + FINGER_JOINTS,
        positions=np.array([state[0] for state in states]),
        velocities=np.array([state[1] for state in states]),
        tip_position=robot.get_ee_position() + BASE_FROM_WORLD_M,
        tip_orientation=sim.get_link_orientation(robot.body_name, robot.ee_link),
        tip_velocity=robot.get_ee_velocity(),
        tip_angular_velocity=sim.get_link_angular_velocity(robot.body_name, robot.ee_link),
        goal_position=np.asarray(goal, dtype=np.float64)[:3] + BASE_FROM_WORLD_M,
    )


def take_joint_targets(environment: Environment) -> None:
    """From now on `environment.step` takes targets of the arm's and fingers' joints, (9,) in rad and m.

    Raises:
        UsageError: it is not a Panda.
    """
    robot = _robot(environment, "joint_command")
    robot.set_action = robot.control_joints


def take_tip_targets(environment: Environment) -> None:
    """From now on `environment.step` takes targets (9,): tip x, y, z and orientation x, y, z, w, both fingers.

    The tip's position is in m in the frame of the base, the fingers' in m.

    Raises:
        UsageError: it is not a Panda.
    """
    robot = _robot(environment, "target_pose")

    def follow(target: Float64) -> None:
        position = target[:3] - BASE_FROM_WORLD_M
        angles = robot.inverse_kinematics(link=robot.ee_link, position=position, orientation=target[3:7])
        robot.control_joints(np.concatenate((angles[:7], target[7:])))

    robot.set_action = follow


def _robot(environment: Environment, interface: str) -> Any:
    if not environment.id.startswith("Panda"):
        raise UsageError(f"The command interface {interface} is for Panda; for {environment.id} use action.")
    return environment.unwrapped.robot


class ArmTargets:
    """What panda-gym would make of an action, from measured joint positions alone.

    A second arm, which never moves by itself: it is put where the first one was measured to be, so
    that its inverse kinematics start from there and end where panda-gym's do.
    """

    def __init__(self, environment_id: str) -> None:
        """Make the arm of a Panda environment.

        Raises:
            UsageError: it is not a Panda.
            DrsError: the simulator is not installed.
        """
        self._environment = Environment(environment_id, fast=False)
        self._robot = _robot(self._environment, "joint_command")
        self._environment.reset(0)

    def joint_targets(
        self, action: NDArray[np.float32], positions: Float64, tip_position: Float64
    ) -> tuple[Float64, Float64]:
        """Targets of the arm's joints (7,) [rad] and the fingers' (2,) [m].

        Args:
            action: (n_actions,) float32.
            positions: (9,) measured [rad, m], arm then fingers.
            tip_position: (3,) measured [m], in the frame of the base. Not computed from `positions`:
                the position that Bullet reports, and panda-gym uses, lags its joints by 2 ms.
        """
        robot = self._robot
        robot.set_joint_angles(positions)
        target = tip_target(action, tip_position) - BASE_FROM_WORLD_M
        arm = robot.inverse_kinematics(link=robot.ee_link, position=target, orientation=np.array(TIP_ORIENTATION))[:7]
        width = 0.0
        if not robot.block_gripper:
            width = float(positions[7] + positions[8] + np.clip(action[-1], -1.0, 1.0) * FINGER_STEP_M)
        return np.asarray(arm, dtype=np.float64), np.full(2, width / 2)

    def close(self) -> None:
        """Free the simulator."""
        self._environment.close()
