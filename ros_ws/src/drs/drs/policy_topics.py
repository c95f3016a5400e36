"""The policy's topics: what comes in, and the answers in the forms that arms take."""

from __future__ import annotations

import time
from typing import Any

from drs_interfaces.msg import Action, Observation, PolicyStatus
from geometry_msgs.msg import PoseStamped
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from drs.conversions import action_to_msg, observation_from_msg
from drs.sim_arm import Arm, arm_targets, is_panda
from drs.state_conversions import joint_positions, joint_state, pose, position_of
from drs.state_input import StateInput, keep
from drs.status import Status
from drs_core.actor import Actor
from drs_core.errors import UsageError
from drs_core.panda import ARM_JOINTS, FINGER_JOINTS, TIP_ORIENTATION, tip_target


class PolicyTopics:
    """Subscriptions and publishers of an active policy node."""

    is_faulty = False
    """Without guards nothing is a fault."""

    def __init__(self, node: LifecycleNode, actor: Actor, status: Status, arm_id: str, source: str) -> None:
        """Wire everything; nothing is answered before `activate`.

        Raises:
            UsageError: the agent cannot act on this source (`observation` or `state`).
        """
        self._node, self._actor, self._arm_id = node, actor, arm_id
        self._joints = tuple(joint.replace("panda", arm_id, 1) for joint in ARM_JOINTS + FINGER_JOINTS)
        self._status = status
        self._states: dict[Any, JointState] = {}
        self._tips: dict[Any, PoseStamped] = {}
        self._waiting: Header | None = None
        publish, subscribe = node.create_lifecycle_publisher, node.create_subscription
        # first, since it may be refused: what is on the graph by then would stay there
        if source == "state":
            self.subscriptions = StateInput(node, actor.agent, self._answer).subscriptions
        else:
            self.subscriptions = [subscribe(Observation, "observation", self._on_observation, 10)]
        self._targets, why = arm_targets(actor.agent)
        if why:
            node.get_logger().warning(why)
        self._action = publish(Action, "action", 10)
        self.publishers = [self._action]
        self._moves_arm = is_panda(actor.agent)
        if self._moves_arm:
            self._pose = publish(PoseStamped, "target_pose", 10)
            self._command = publish(JointState, "joint_command", 10)
            self._fingers = publish(JointState, "finger_command", 10)
            self.publishers += [self._pose, self._command, self._fingers]
            self.subscriptions += [
                subscribe(JointState, "joint_states", self._on_joints, 10),
                subscribe(PoseStamped, "end_effector/pose", self._on_tip, 10),
            ]
        self.active = False
        status.say(PolicyStatus.INACTIVE, "Inactive.")

    def activate(self) -> None:
        """Answer from now on."""
        self.active = True
        self._status.forget()
        self._status.say(PolicyStatus.WAITING, "Waiting for an observation.")

    def deactivate(self) -> None:
        """Answer no more."""
        self._status.say(PolicyStatus.INACTIVE, "Inactive.")
        self.active, self._waiting = False, None

    def figures(self) -> dict[str, str]:
        """What /diagnostics says besides the status."""
        return {}

    def close(self) -> None:
        """Take everything off the graph."""
        for publisher in self.publishers:
            self._node.destroy_lifecycle_publisher(publisher)
        for subscription in self.subscriptions:
            self._node.destroy_subscription(subscription)
        if self._targets is not None:
            self._targets.close()

    def _on_joints(self, message: JointState) -> None:
        keep(self._states, message)
        self._answer_waiting()

    def _on_tip(self, message: PoseStamped) -> None:
        keep(self._tips, message)
        self._answer_waiting()

    def _on_observation(self, message: Observation) -> None:
        if message.terminated or message.truncated:
            return
        try:
            observation = observation_from_msg(message)
        except UsageError as error:
            self._refuse(error)
            return
        self._answer(message.header, message.number, observation, message.step)

    def _answer(self, header: Header, number: int, observation: dict[str, Any], step: int) -> None:
        if not self.active:
            return
        arrived = time.perf_counter()
        try:
            action = self._actor.act(observation, step)
        except UsageError as error:
            self._refuse(error)
            return
        self._action.publish(action_to_msg(action, header, number))
        self._status.message.answered += 1
        self._status.message.latency_s = time.perf_counter() - arrived
        self._status.say(PolicyStatus.ACTING, "Acting.")
        if self._moves_arm:
            self._waiting, self._newest = header, action
            self._answer_waiting()

    def _refuse(self, error: UsageError) -> None:
        if not self.active:
            return
        self._status.message.refused += 1
        self._status.say(PolicyStatus.REFUSING, str(error))
        self._node.get_logger().warning(str(error), throttle_duration_sec=1.0)

    def _answer_waiting(self) -> None:
        """Send the arm's targets as soon as its measurements of the observation's moment are there."""
        header = self._waiting
        key = None if header is None else (header.stamp.sec, header.stamp.nanosec)
        if key not in self._states or key not in self._tips:
            return
        self._waiting = None
        try:
            arm = Arm(joint_positions(self._states[key], self._joints), position_of(self._tips[key]))
        except UsageError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        self._publish_targets(header, arm)

    def _publish_targets(self, moment: Header, arm: Arm) -> None:
        header = Header(stamp=moment.stamp, frame_id=f"{self._arm_id}_link0")
        if self._targets is not None:
            joints, fingers = self._targets.joint_targets(self._newest, arm.positions, arm.tip_position)
            # fingers first: whoever waits for the arm's command has both then
            self._fingers.publish(joint_state(header, self._joints[7:], fingers))
            self._command.publish(joint_state(header, self._joints[:7], joints))
        self._pose.publish(pose(header, tip_target(self._newest, arm.tip_position), TIP_ORIENTATION))
