"""Guards, each a pure function: None where nothing is wrong, or what was found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from operator import le

import numpy as np
from numpy.typing import NDArray

from drs_core.serving.arm import JointLimits
from drs_core.serving.config import ServingConfig
from drs_core.serving.inputs import ArmState, Inputs, PoseSample
from drs_core.serving.results import Result, Verdict

Float64 = NDArray[np.float64]
Box = tuple[tuple[float, ...], tuple[float, ...]]

SILENCE_S = 0.2
"""After so long without a command an arm's controller takes it that nobody is moving the arm."""
_UNIT_TOLERANCE = 0.01
_RELATIVE_ROUNDING = 1e-6
_BACKWARD = np.array([[0.0, 0.0, -1.0, 1.0], [0.0, 1.0, -2.0, 1.0], [-1.0, 3.0, -3.0, 1.0]])
"""First, second and third backward difference of four values, oldest first."""
_ROUNDING_RAD = 1e-12
_POSITION_ROUNDING_RAD = 2e-9


def finite_poses(inputs: Inputs) -> Verdict | None:
    """Poses have their numbers, all finite, and unit quaternions."""
    for name, pose in inputs.poses():
        found = _pose(name, pose)
        if found is not None:
            return found
    for name, values, size in (
        ("tip velocity", inputs.tip_velocity, 3),
        ("object velocity", inputs.object_velocity, 6),
    ):
        if values is None:
            continue
        if np.shape(values) != (size,):
            return Verdict(Result.INCOMPLETE, f"The {name} has shape {np.shape(values)}, not ({size},).")
        if not np.isfinite(values).all():
            return Verdict(Result.NOT_FINITE, f"The {name} is not.")
    return None


def _pose(name: str, pose: PoseSample) -> Verdict | None:
    if len(pose.position) != 3 or len(pose.orientation) != 4:
        return Verdict(Result.INCOMPLETE, f"The {name} has {len(pose.position)} + {len(pose.orientation)} numbers.")
    if not all(map(math.isfinite, pose.position)) or not all(map(math.isfinite, pose.orientation)):
        return Verdict(Result.NOT_FINITE, f"The {name} is not.")
    norm = math.hypot(*pose.orientation)
    if abs(norm - 1.0) > _UNIT_TOLERANCE:
        return Verdict(Result.INCOMPLETE, f"The {name}'s orientation has norm {norm:.3g}, not 1.")
    return None


def right_frames(inputs: Inputs, frame: str) -> Verdict | None:
    """Poses are given in the frame of the base."""
    for name, pose in inputs.poses():
        if pose.frame != frame:
            return Verdict(Result.WRONG_FRAME, f"The {name} is in {pose.frame[:80]!r}, not in {frame!r}.")
    return None


def fresh(inputs: Inputs, now_s: float, config: ServingConfig) -> Verdict | None:
    """Measurements are of now, and of one moment; a goal stays valid."""
    stamps = [("joint states", inputs.joints), ("tip pose", inputs.tip), ("object pose", inputs.object)]
    moments = [(name, sample.stamp_s) for name, sample in stamps if sample is not None]
    for name, stamp_s in moments:
        if not math.isfinite(stamp_s):
            return Verdict(Result.NOT_FINITE, f"The moment of the {name} is not.")
        if stamp_s - now_s > config.clock_ahead_max_s:
            return Verdict(
                Result.CLOCK,
                f"The moment of the {name} is {stamp_s - now_s:.3g} s ahead; allowed are {config.clock_ahead_max_s} s.",
            )
    for name, stamp_s in moments:
        if now_s - stamp_s > config.input_age_max_s:
            return Verdict(
                Result.STALE,
                f"The age of the {name} is {now_s - stamp_s:.3g} s; allowed are {config.input_age_max_s} s.",
            )
    if inputs.joints is not None and inputs.tip is not None:
        skew = abs(inputs.joints.stamp_s - inputs.tip.stamp_s)
        if skew > config.input_skew_max_s:
            return Verdict(
                Result.STALE,
                f"Joint states and tip pose are {skew:.3g} s apart; allowed are {config.input_skew_max_s} s.",
            )
    return None


def workspace(config: ServingConfig, margin_m: float) -> Box:
    """The lowest and the highest corner of the workspace and so much around it [m]."""
    return (
        tuple(value - margin_m for value in config.workspace_min_m),
        tuple(value + margin_m for value in config.workspace_max_m),
    )


def in_box(point: Sequence[float], box: Box) -> bool:
    """Whether a point (3,) [m] lies in a box; NaN does not."""
    x, y, z = point
    (low_x, low_y, low_z), (high_x, high_y, high_z) = box
    return low_x <= x <= high_x and low_y <= y <= high_y and low_z <= z <= high_z


def inside(goal: Float64, tip: Float64, config: ServingConfig) -> Verdict | None:
    """Goal and tip are in the workspace or its margin."""
    box = workspace(config, config.workspace_margin_m)
    for result, point in ((Result.GOAL_OUTSIDE, goal.tolist()), (Result.TIP_OUTSIDE, tip.tolist())):
        if not in_box(point, box):
            here = ", ".join(f"{value:.3f}" for value in point)
            return Verdict(
                result,
                f"It is at ({here}) m; allowed are {config.workspace_min_m} to {config.workspace_max_m} m "
                f"and {config.workspace_margin_m} m around them.",
            )
    return None


def at_rest(state: ArmState, config: ServingConfig) -> Verdict | None:
    """No joint moves."""
    speed = float(np.abs(state.velocities).max())
    if speed > config.start_speed_max_rad_s:
        return Verdict(
            Result.NOT_AT_REST, f"A joint has {speed:.3g} rad/s; allowed are {config.start_speed_max_rad_s} rad/s."
        )
    return None


def joints_inside(positions: Float64, low: Float64, high: Float64, joints: Sequence[str]) -> Verdict | None:
    """Joint positions (7,) are in their range [rad]."""
    for name, value, least, most in zip(joints, positions, low, high):
        if not least <= value <= most:
            return Verdict(
                Result.JOINT_OUTSIDE, f"{name} is at {value:.4g} rad; allowed are {least:.4g} to {most:.4g}."
            )
    return None


def following(positions: Float64, commanded: Float64, config: ServingConfig) -> Verdict | None:
    """The arm is where it was sent, (7,) [rad] each."""
    error = float(np.abs(positions - commanded).max())
    if not error <= config.following_error_max_rad:
        return Verdict(
            Result.NOT_FOLLOWING,
            f"A joint is {error:.3g} rad from its command; allowed are {config.following_error_max_rad} rad.",
        )
    return None


def tip_matches(tip: Float64, computed: Float64, config: ServingConfig) -> Verdict | None:
    """The tip pose is that of the joint states, (3,) [m] each: right frame, offset and arm."""
    distance = math.dist(tip.tolist(), computed.tolist())
    if not distance <= config.tip_mismatch_max_m:
        return Verdict(Result.MISMATCH, f"They are {distance:.3g} m apart; allowed are {config.tip_mismatch_max_m} m.")
    return None


def limited_step(target: Float64, tip: Float64, config: ServingConfig) -> Float64:
    """The target (3,) [m], drawn towards the tip where it is too far, and into the workspace."""
    length = math.dist(target.tolist(), tip.tolist())
    if length > config.step_max_m:
        target = tip + (target - tip) * (config.step_max_m / length)
    box = zip(config.workspace_min_m, target.tolist(), config.workspace_max_m)
    return np.array([min(max(value, low), high) for low, value, high in box])


def publishable(history: Float64, limits: JointLimits, period_s: float) -> Verdict | None:
    """The last of four consecutive commands may follow the other three.

    Args:
        history: (4, 7) [rad], oldest first.
        limits: of positions, and of velocity, acceleration and jerk as finite differences.
        period_s: time between two commands.
    """
    newest = history[3].tolist()
    if not all(map(math.isfinite, newest)):
        return Verdict(Result.BAD_COMMAND, "It is not finite.")
    low, high, differences = _allowed(limits, period_s)
    if not (all(map(le, low, newest)) and all(map(le, newest, high))):
        return Verdict(Result.BAD_COMMAND, "A position is outside its range.")
    excess = np.abs(_BACKWARD @ history)
    excess -= differences
    if (excess <= _ROUNDING_RAD).all():
        return None
    worst = excess.max(axis=1)
    # the first of the three that is broken, NaN too
    order = int((~(worst <= _ROUNDING_RAD)).argmax())
    name, above = ("velocity", "acceleration", "jerk")[order], float(worst[order]) / period_s ** (order + 1)
    return Verdict(Result.BAD_COMMAND, f"A joint's {name} is above its limit by {above:.3g}.")


@lru_cache(maxsize=8)
def _allowed(limits: JointLimits, period_s: float) -> tuple[list[float], list[float], Float64]:
    """Lowest and highest positions, and the largest differences (3, 7) of `_BACKWARD` [rad]."""
    bounds = (limits.velocity_max_rad_s, limits.acceleration_max_rad_s2, limits.jerk_max_rad_s3)
    return (
        (limits.position_min_rad - _POSITION_ROUNDING_RAD).tolist(),
        (limits.position_max_rad + _POSITION_ROUNDING_RAD).tolist(),
        np.array([bound * (period_s**power * (1.0 + _RELATIVE_ROUNDING)) for power, bound in enumerate(bounds, 1)]),
    )
