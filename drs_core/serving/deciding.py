"""From what is measured to joint positions to go to: the policy, the step limit, inverse kinematics."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import DrsError
from drs_core.panda import FINGER_STEP_M, TIP_ORIENTATION, tip_target
from drs_core.serving import guards
from drs_core.serving.config import ServingConfig
from drs_core.serving.kinematics import Bounds, Kinematics
from drs_core.serving.measuring import Measured
from drs_core.serving.observing import Task
from drs_core.serving.results import Result, Verdict

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Act = Callable[[Mapping[str, Float32], int], Float32]
"""Observation and number of steps since the goal came -> action (n_actions,) float32."""

_DOWN = np.array(TIP_ORIENTATION)
_MAX_FINGER_WIDTH_M = 0.08


@dataclass(frozen=True, eq=False)
class Target:
    """Where the policy sends the arm.

    Attributes:
        position: (3,) [m] of the tip in the frame of the base; the hand points down.
        joints: (7,) [rad] that bring it there.
        finger_width_m: both fingers together.
        action: (n_actions,) float32 behind it.
    """

    position: Float64
    joints: Float64
    finger_width_m: float
    action: Float32


def action_for(seen: Mapping[str, Float32], step: int, act: Act, task: Task) -> Float32 | Verdict:
    """The policy's action (n_actions,) float32, if it is one."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            action = act(seen, step)
    except DrsError as error:
        return Verdict(Result.BAD_ACTION, str(error))
    if np.shape(action) != (task.actions,) or not all(map(math.isfinite, action.tolist())):
        return Verdict(Result.BAD_ACTION, f"It must be {task.actions} finite numbers.")
    return action


def target_of(
    action: Float32, measured: Measured, task: Task, kinematics: Kinematics, bounds: Bounds, config: ServingConfig
) -> Target | Verdict:
    """Where an action sends the arm, if the arm can go there within its joints' bounds."""
    position = guards.limited_step(tip_target(action, measured.tip), measured.tip, config)
    solution = kinematics.inverse(measured.arm.positions, position, _DOWN, bounds)
    if not solution.converged:
        return Verdict(Result.OUT_OF_REACH, f"It is missed by {solution.position_error_m:.3g} m.")
    width_m = 0.0
    if task.has_gripper:
        change_m = float(np.clip(action[-1], -1.0, 1.0)) * FINGER_STEP_M
        width_m = min(max(measured.arm.finger_width_m + change_m, 0.0), _MAX_FINGER_WIDTH_M)
    return Target(position, solution.positions, width_m, action)
