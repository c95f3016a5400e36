"""The names of the nodes' parameters, without ROS: what nobody has is a slip that ROS passes over in silence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches

from drs_core.errors import UsageError, shown
from drs_core.parameters import TUNER
from drs_core.serving.config import ServingConfig

NODES: Mapping[str, frozenset[str]] = {
    "simulator_node": frozenset(
        (
            "environment",
            "agent",
            "agents_root",
            "stream",
            "real_time_factor",
            "command_interface",
            "synchronous",
            "fast_stepping",
            "seed",
        )
    ),
    "tuner_node": frozenset(TUNER),
    "policy_node": frozenset(
        (
            "agent",
            "agent_digest",
            "arm_id",
            "input",
            "tip_velocity",
            "publish_joint_command",
            "publish_joint_trajectory",
            "publish_target_pose",
            "publish_steps",
            "realtime_priority",
            *(field.name for field in fields(ServingConfig)),
            "autoconfigure",
            "autostart",
        )
    ),
    "mock_arm_node": frozenset(
        ("arm_id", "command_interface", "command_period_s", "state_rate_hz", "time_constant_s"),
    ),
    "recorder_node": frozenset(("output", "topics", "seconds")),
}
"""Node -> its parameters. A test holds this against what the nodes declare."""

EVERY = frozenset[str]().union(*NODES.values())
_OF_ROS = frozenset(("use_sim_time", "start_type_description_service"))
_OF_ROS_BEGIN = "qos_overrides."
_NEAR = 0.75
"""Of 1: `sede` for `seed` is, `update_rate` for `updates` is not."""


def is_of_ros(name: str) -> bool:
    """Whether ROS itself gives every node this parameter."""
    return name in _OF_ROS or name.startswith(_OF_ROS_BEGIN)


def is_of_a_node(name: object) -> bool:
    """Whether any node of drs has this parameter."""
    return isinstance(name, str) and (name in EVERY or is_of_ros(name))


def is_slip(name: str, known: Iterable[str]) -> bool:
    """Whether an unknown name is so near to a known one that this is what was meant."""
    return bool(get_close_matches(name, sorted(known), 1, _NEAR))


def nearest(name: str, known: Iterable[str]) -> str:
    """The end of a sentence on an unknown name: the known one that comes nearest, or where they are."""
    close = get_close_matches(name, sorted(known), 1)
    return f"did you mean {close[0]!r}?" if close else "docs/ros.md lists them."


def check_given(names: Iterable[str], declared: Iterable[str]) -> None:
    """Look at what a node is given: sections for all nodes (``/**``) may hold what another node has, of drs or not.

    Raises:
        UsageError: no node of drs has one of these parameters, but one that is nearly called so.
    """
    own = frozenset(declared)
    for name in names:
        if name not in own | EVERY and not is_of_ros(name) and is_slip(name, own | EVERY):
            known = own if is_slip(name, own) else EVERY
            raise UsageError(f"No node of drs has the parameter {shown(name)}; {nearest(name, known)}")
