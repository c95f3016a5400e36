"""What an arm's drivers publish, and the newest of it."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from drs.arm_conversions import joint_sample, pose_sample
from drs.qos import LATCHED, NEWEST, NO_EVENTS
from drs_core.serving.arm import Arm
from drs_core.serving.inputs import Inputs, PoseSample
from drs_core.serving.observing import Differentiator, Float64, Task


class ArmInputs:
    """Subscriptions to joint states, tip, goal and object.

    Attributes:
        subscriptions: all of them.
    """

    def __init__(self, node: Node, arm: Arm, task: Task, tip_velocity: str) -> None:
        """Listen; `tip_velocity` is `joints` or `pose`, the way that the tip's velocity is found."""
        self._arm = arm
        self._joints: JointState | None = None
        self._poses: dict[str, PoseSample] = {}
        self._object_motion, self._object_velocity = Differentiator(), None
        self._tip_motion, self._tip_velocity = Differentiator() if tip_velocity == "pose" else None, None
        subscribe = node.create_subscription
        self._measurements = [
            subscribe(JointState, "joint_states", self._on_joints, NEWEST, **NO_EVENTS),
            subscribe(PoseStamped, "end_effector/pose", self._on_tip, NEWEST, **NO_EVENTS),
        ]
        if task.has_object:
            self._measurements.append(subscribe(PoseStamped, "object_pose", self._on_object, NEWEST, **NO_EVENTS))
        # a latched goal may have been published before; who does not latch is heard by the other
        goals = [subscribe(PoseStamped, "goal_pose", self._on_goal, qos, **NO_EVENTS) for qos in (LATCHED, 1)]
        self.subscriptions = self._measurements + goals

    def newest(self) -> Inputs:
        """Everything that was delivered last."""
        joints = None if self._joints is None else joint_sample(self._joints)
        get = self._poses.get
        return Inputs(joints, get("goal"), get("tip"), self._tip_velocity, get("object"), self._object_velocity)

    def take(self) -> None:
        """Deliver measurements that wait for the executor, which a callback keeps busy."""
        for subscription in self._measurements:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                subscription.callback(taken[0])

    def _on_joints(self, message: JointState) -> None:
        # a gripper publishes its own joint states on the same topic
        if any(name in self._arm.joints for name in message.name):
            self._joints = message

    def _on_tip(self, message: PoseStamped) -> None:
        sample = self._poses["tip"] = pose_sample(message)
        if self._tip_motion is not None:
            velocity = _velocity(self._tip_motion, sample)
            self._tip_velocity = self._tip_velocity if velocity is None else velocity[:3]

    def _on_goal(self, message: PoseStamped) -> None:
        self._poses["goal"] = pose_sample(message)

    def _on_object(self, message: PoseStamped) -> None:
        sample = self._poses["object"] = pose_sample(message)
        velocity = _velocity(self._object_motion, sample)
        self._object_velocity = self._object_velocity if velocity is None else velocity


def _velocity(motion: Differentiator, sample: PoseSample) -> Float64 | None:
    """Linear and angular velocity (6,) since the pose before; None where it is no later."""
    return motion.update(sample.stamp_s, np.array(sample.position), np.array(sample.orientation))
