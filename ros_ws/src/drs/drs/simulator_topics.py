"""The simulator's topics: publishes every frame of a stream, keeps the newest command for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from drs_interfaces.msg import Action, Observation
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from drs.conversions import action_from, observation_to_msg
from drs.qos import LATCHED
from drs.state_conversions import (
    joint_positions,
    joint_state,
    joint_targets_from_msg,
    pose,
    stamp,
    tip_targets_from_msg,
    twist,
)
from drs.stream import Frame, Stream
from drs_core.errors import UsageError
from drs_core.panda import FINGER_JOINTS

BASE_FRAME, WORLD_FRAME = "panda_link0", "world"
_TYPES = {"action": Action, "joint_command": JointState, "target_pose": PoseStamped}


class SimulatorTopics:
    """Publishers and the command subscription of one stream, which may begin later."""

    def __init__(self, node: Node, kind: str, group: CallbackGroup, on_command: Callable[[], None]) -> None:
        """`kind` is the command interface; `on_command` is called after every command that can be used."""
        self._node, self._kind, self._on_command = node, kind, on_command
        self._stream: Stream | None = None
        self._command: Any = None
        self._fingers: tuple[Any, NDArray[np.floating]] = (None, np.zeros(2))
        self._observation = node.create_publisher(Observation, "observation", 10)
        self._clock = node.create_publisher(Clock, "/clock", 10)
        self._joints = node.create_publisher(JointState, "joint_states", 10)
        self._pose = node.create_publisher(PoseStamped, "end_effector/pose", 10)
        self._twist = node.create_publisher(TwistStamped, "end_effector/twist", 10)
        self._trace = node.create_publisher(Path, "end_effector/trace", LATCHED)
        self._goal = node.create_publisher(PoseStamped, "goal_pose", LATCHED)
        self._path = Path()
        self._commands = node.create_subscription(_TYPES[kind], kind, self._receive, 10, callback_group=group)
        self._finger_commands = None
        if kind != "action":
            self._finger_commands = node.create_subscription(
                JointState, "finger_command", self._receive_fingers, 10, callback_group=group
            )

    def wanted(self) -> bool:
        """Whether anybody listens, or gives commands."""
        publishers = (
            self._observation, self._clock, self._joints, self._pose, self._twist, self._trace, self._goal,
        )  # fmt: skip
        listened = any(publisher.get_subscription_count() for publisher in publishers)
        return listened or self._node.count_publishers(self._commands.topic_name) > 0

    def attach(self, stream: Stream) -> None:
        """Show this stream's frames from now on, and take commands for it."""
        self._stream = stream

    def publish(self, frame: Frame) -> Observation:
        """Show a frame on every topic; the observation comes last, when all else is there."""
        at = stamp(frame.time_s)
        self._clock.publish(Clock(clock=at))
        self._shown: list[tuple[Any, Any]] = []
        header = Header(stamp=at, frame_id=BASE_FRAME)
        state = frame.state
        if state is not None:
            self._show(self._joints, joint_state(header, state.joints, state.positions, state.velocities))
        if state is not None and state.tip_position is not None:
            tip = pose(header, state.tip_position, state.tip_orientation)
            if frame.count == 0:
                self._path = Path(header=header)
                self._goal.publish(pose(header, state.goal_position, (0.0, 0.0, 0.0, 1.0)))
            self._show(self._pose, tip)
            self._show(self._twist, twist(header, state))
            self._path.poses.append(tip)
            self._path.header = header
            self._trace.publish(self._path)
        observation = self.message(frame)
        self._show(self._observation, observation)
        return observation

    def repeat(self) -> None:
        """Show the newest observation again, with the measurements of its moment."""
        for publisher, message in self._shown:
            publisher.publish(message)

    def _show(self, publisher: Publisher, message: Any) -> None:
        self._shown.append((publisher, message))
        publisher.publish(message)

    def message(self, frame: Frame) -> Observation:
        """A frame as an observation."""
        assert self._stream is not None
        environment = self._stream.environment
        message = observation_to_msg(
            environment.id, environment.spaces, frame.step, frame.number, frame.seed, frame.count
        )
        message.header = Header(stamp=stamp(frame.time_s), frame_id=WORLD_FRAME)
        return message

    def answered(self) -> bool:
        """Whether the newest command, with that of the fingers where somebody gives one, answers the newest frame."""
        if self._command is None or self._stream is None:
            return False
        frame = self._stream.frame
        if self._kind == "action":
            return bool(self._command.observation == frame.number)
        now = stamp(frame.time_s)
        # topics keep no order among each other: the fingers may come after the arm
        apart = self._finger_commands is not None and self._finger_commands.get_publisher_count() > 0
        return bool(self._command.header.stamp == now and (not apart or self._fingers[0] == now))

    def take_command(self) -> NDArray[np.floating] | None:
        """The newest command, once."""
        command, self._command = self._command, None
        return None if command is None or self._stream is None else self._values(command, self._stream)

    def _values(self, command: Any, stream: Stream) -> NDArray[np.floating]:
        if isinstance(command, Action):
            spaces = stream.environment.spaces
            return action_from(command.values, spaces.low, spaces.high)
        if isinstance(command, JointState):
            return joint_targets_from_msg(command, self._fingers[1])
        return tip_targets_from_msg(command, self._fingers[1])

    def _receive(self, message: Any) -> None:
        if self._stream is None:
            return
        try:
            self._values(message, self._stream)
        except UsageError as error:
            self._warn(error)
            return
        self._command = message
        self._on_command()

    def _receive_fingers(self, message: JointState) -> None:
        try:
            self._fingers = (message.header.stamp, joint_positions(message, FINGER_JOINTS))
        except UsageError as error:
            self._warn(error)
            return
        self._on_command()

    def _warn(self, error: UsageError) -> None:
        self._node.get_logger().warning(str(error), throttle_duration_sec=1.0)
