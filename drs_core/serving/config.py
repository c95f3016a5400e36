"""What serving is told: rates, bounds, margins."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drs_core.errors import UsageError

RANGES = {
    "policy_period_s": (0.001, 1.0),
    "input_age_max_s": (0.001, 10.0),
    "input_skew_max_s": (0.0, 10.0),
    "clock_ahead_max_s": (0.0, 10.0),
    "workspace_margin_m": (0.0, 0.5),
    "step_max_m": (0.0001, 0.2),
    "velocity_scale": (0.01, 1.0),
    "acceleration_scale": (0.01, 1.0),
    "jerk_scale": (0.01, 1.0),
    "joint_margin_rad": (0.001, 0.5),
    "following_error_max_rad": (0.01, 3.0),
    "start_speed_max_rad_s": (0.0, 1.0),
    "tip_mismatch_max_m": (0.001, 1.0),
    "posture_gain": (0.0, 1.0),
    "tip_from_hand_m": (-0.5, 0.5),
    "pose_from_hand_m": (-0.5, 0.5),
}
"""Lowest and highest value of every setting that is a single number."""


@dataclass(frozen=True)
class ServingConfig:
    """Settings of serving; positions are in the frame of the base.

    Attributes:
        policy_period_s: time between two actions; panda-gym's is 0.04.
        commands_per_period: commands between two actions, evenly spaced.
        input_age_max_s: older joint states, poses or answers stop the arm.
        input_skew_max_s: most between the moments of joint states and of the tip pose.
        clock_ahead_max_s: most that an input may be stamped ahead of the clock.
        workspace_min_m, workspace_max_m: box that the tip is sent to.
        workspace_margin_m: goal and tip may lie so far outside that box; a tip that is further out stops the arm.
        step_max_m: most between the measured tip and its target.
        velocity_scale, acceleration_scale, jerk_scale: part of the arm's limits that is used.
        joint_margin_rad: kept to the ends of each joint.
        following_error_max_rad: most between a joint's command and its measurement.
        start_speed_max_rad_s: a joint that is quicker does not count as at rest.
        tip_mismatch_max_m: most between the tip pose and the tip of the joint states.
        posture_gain: pull of the elbow to the neutral posture, see `Kinematics`.
        tip_from_hand_m: the tip that the agent was trained with, along the hand's z.
        pose_from_hand_m: the point whose pose comes in; panda_hand_tcp's is 0.1034.
    """

    policy_period_s: float = 0.04
    commands_per_period: int = 4
    input_age_max_s: float = 0.1
    input_skew_max_s: float = 0.05
    clock_ahead_max_s: float = 0.05
    workspace_min_m: tuple[float, float, float] = (0.25, -0.4, 0.02)
    workspace_max_m: tuple[float, float, float] = (0.8, 0.4, 0.6)
    workspace_margin_m: float = 0.02
    step_max_m: float = 0.05
    velocity_scale: float = 0.5
    acceleration_scale: float = 0.5
    jerk_scale: float = 0.1
    joint_margin_rad: float = 0.05
    following_error_max_rad: float = 0.3
    start_speed_max_rad_s: float = 0.05
    tip_mismatch_max_m: float = 0.05
    posture_gain: float = 0.02
    tip_from_hand_m: float = 0.105
    pose_from_hand_m: float = 0.105

    def __post_init__(self) -> None:
        """Raise UsageError where a value is not allowed."""
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and low <= value <= high):
                raise UsageError(f"{name} is {value}; allowed are {low} to {high}.")
        if not (isinstance(self.commands_per_period, int) and 1 <= self.commands_per_period <= 1000):
            raise UsageError(f"commands_per_period is {self.commands_per_period}; allowed are whole numbers 1 to 1000.")
        corners = self.workspace_min_m, self.workspace_max_m
        if not all(len(corner) == 3 and all(map(math.isfinite, corner)) for corner in corners):
            raise UsageError(
                f"The workspace {self.workspace_min_m} to {self.workspace_max_m} is not three finite numbers each."
            )
        if not all(low < high for low, high in zip(self.workspace_min_m, self.workspace_max_m)):
            raise UsageError(f"workspace_min_m {self.workspace_min_m} must lie below {self.workspace_max_m}.")

    @property
    def command_period_s(self) -> float:
        """Time between two commands."""
        return self.policy_period_s / self.commands_per_period
