"""What an arm is told: `joint_command`, `joint_trajectory`, `target_pose` and `finger_command`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from drs.arm_conversions import trajectory
from drs.conversions import floats
from drs.state_conversions import joint_state, pose, stamp
from drs_core.serving.arm import Arm
from drs_core.serving.motion import Motion
from drs_core.serving.server import Server

_DEPTH = 10
"""One that is lost on the way makes a jump of the next."""


class ArmCommands:
    """A publisher for each topic that is wanted.

    Attributes:
        publishers: by topic.
    """

    def __init__(self, node: Node, arm: Arm, with_fingers: bool, values: Mapping[str, Any]) -> None:
        """`values` says which topics: publish_joint_command and so on."""
        self._arm, self._header = arm, Header(frame_id=arm.base_frame)
        # made once: to make a message takes longer than to fill it
        self._joint_command = JointState(header=self._header, name=list(arm.joints))
        kinds = {"joint_command": JointState, "joint_trajectory": JointTrajectory, "target_pose": PoseStamped}
        wanted = {topic: kind for topic, kind in kinds.items() if values[f"publish_{topic}"]}
        if with_fingers:
            wanted["finger_command"] = JointState
        self.publishers = {topic: node.create_publisher(kind, topic, _DEPTH) for topic, kind in wanted.items()}

    def publish(self, motion: Motion, server: Server, now_s: float) -> None:
        """Tell of a command that was given at a moment of the node's clock [s]."""
        for topic, message in self.messages(motion, server, now_s):
            self.publishers[topic].publish(message)

    def messages(self, motion: Motion, server: Server, now_s: float) -> Iterator[tuple[str, Any]]:
        """Topics, and what is told on each; `joint_command` is one object, filled anew every time."""
        header, answer = self._header, server.answer
        header.stamp = stamp(now_s)
        for topic in self.publishers:
            if topic == "joint_command":
                self._joint_command.position = floats(motion.positions)
                yield topic, self._joint_command
            elif topic == "joint_trajectory":
                yield topic, trajectory(header, self._arm.joints, motion, server.config.command_period_s)
            elif topic == "target_pose":
                yield topic, pose(header, *server.tip_pose(motion))
            elif answer is not None:
                fingers = np.full(2, answer.target.finger_width_m / 2)
                yield topic, joint_state(header, self._arm.fingers, fingers)
