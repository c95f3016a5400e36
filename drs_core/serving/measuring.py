"""From inputs to what they say about arm, tip, goal and object, if the first guards let them through."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from drs_core.serving import guards
from drs_core.serving.arm import Arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.inputs import ArmState, Inputs, PoseSample, arm_state
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.observing import Task, observation
from drs_core.serving.results import Result, Verdict

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measured:
    """One moment, in the frame of the base.

    Attributes:
        arm: its joints.
        tip, goal: (3,) [m].
        observation: what the agent sees of it, by part, float32.
    """

    arm: ArmState
    tip: Float64
    goal: Float64
    observation: dict[str, Float32]


def measured(
    inputs: Inputs, now_s: float, arm: Arm, task: Task, kinematics: Kinematics, config: ServingConfig
) -> Measured | Verdict:
    """What the inputs say, or which guard stopped them: finite, complete, fresh, of one arm, in the workspace."""
    if inputs.joints is None:
        return Verdict(Result.NO_INPUT, "Joint states are missing.")
    state = arm_state(inputs.joints, arm, task.has_gripper)
    if isinstance(state, Verdict):
        return state
    found = guards.finite_poses(inputs) or guards.right_frames(inputs, arm.base_frame)
    if found is not None:
        return found
    if inputs.goal is None:
        return Verdict(Result.NO_INPUT, "The goal is missing.")
    if task.has_object and (inputs.object is None or inputs.object_velocity is None):
        return Verdict(Result.NO_INPUT, "The object's pose or velocity is missing.")
    found = guards.fresh(inputs, now_s, config)
    if found is not None:
        return found
    goal = np.array(inputs.goal.position, dtype=np.float64)
    tip = kinematics.tip_position(state.positions)
    if inputs.tip is not None:
        computed, tip = tip, _tip(inputs.tip, config.tip_from_hand_m - config.pose_from_hand_m)
        found = guards.tip_matches(tip, computed, config)
    found = found or guards.inside(goal, tip, config)
    if found is not None:
        return found
    # numbers that are finite but far beyond an arm become infinite here, and are found
    with np.errstate(over="ignore", invalid="ignore"):
        seen = _observation(inputs, state, tip, goal, task, kinematics)
    if not all(map(math.isfinite, chain.from_iterable([part.tolist() for part in seen.values()]))):
        return Verdict(Result.NOT_FINITE, "A velocity or a position is too large for the agent.")
    return Measured(state, tip, goal, seen)


def _tip(pose: PoseSample, tip_from_pose_m: float) -> Float64:
    position = np.array(pose.position, dtype=np.float64)
    if tip_from_pose_m:
        x, y, z, w = pose.orientation
        # the hand's z axis: third column of the rotation matrix
        position += tip_from_pose_m * np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return position


def _observation(
    inputs: Inputs, state: ArmState, tip: Float64, goal: Float64, task: Task, kinematics: Kinematics
) -> dict[str, Float32]:
    velocity = inputs.tip_velocity
    if velocity is None:
        velocity = kinematics.tip_velocity(state.positions, state.velocities)
    if inputs.object is None or not task.has_object:
        return observation(task, tip, velocity, goal, state.finger_width_m)
    return observation(
        task,
        tip,
        velocity,
        goal,
        state.finger_width_m,
        np.array(inputs.object.position, dtype=np.float64),
        inputs.object.orientation,
        inputs.object_velocity,
    )
