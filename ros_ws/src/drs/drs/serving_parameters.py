"""Settings of serving as node parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drs.declare import Declared
from drs_core.serving.config import RANGES, ServingConfig

_DESCRIPTIONS = {
    "policy_period_s": "time between two actions [s]",
    "commands_per_period": "commands between two actions",
    "input_age_max_s": "older joint states, poses or answers stop the arm [s]",
    "input_skew_max_s": "most between the moments of joint states and tip pose [s]",
    "clock_ahead_max_s": "most that an input may be stamped ahead of the clock [s]",
    "workspace_min_m": "lowest x, y, z that the tip is sent to [m]",
    "workspace_max_m": "highest x, y, z that the tip is sent to [m]",
    "workspace_margin_m": "goal and tip may lie so far outside the workspace [m]",
    "step_max_m": "most between the measured tip and its target [m]",
    "velocity_scale": "part of the joints' velocity limits that is used",
    "acceleration_scale": "part of the joints' acceleration limits that is used",
    "jerk_scale": "part of the joints' jerk limits that is used",
    "joint_margin_rad": "kept to the ends of each joint [rad]",
    "following_error_max_rad": "most between a joint's command and its measurement [rad]",
    "start_speed_max_rad_s": "a joint that is quicker does not count as at rest [rad/s]",
    "tip_mismatch_max_m": "most between the tip pose and the tip of the joint states [m]",
    "posture_gain": "pull of the elbow to the neutral posture",
    "tip_from_hand_m": "the tip that the agent was trained with, along the hand's z [m]",
    "pose_from_hand_m": "the point whose pose comes in, along the hand's z [m]; panda_hand_tcp: 0.1034",
}


def _declared(name: str, description: str) -> Declared:
    default = getattr(ServingConfig(), name)
    low, high = RANGES.get(name, (None, None))
    return Declared(name, list(default) if isinstance(default, tuple) else default, description, low, high)


PARAMETERS = tuple(_declared(name, description) for name, description in _DESCRIPTIONS.items())


def serving_config(values: Mapping[str, Any]) -> ServingConfig:
    """The settings in force.

    Raises:
        UsageError: one is out of its range.
    """
    chosen = {name: values[name] for name in _DESCRIPTIONS}
    return ServingConfig(**{k: tuple(v) if isinstance(v, list) else v for k, v in chosen.items()})
