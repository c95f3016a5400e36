"""mock_arm_node: an arm to try a policy node on; it stops with a reflex where the real one would."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from drs.answering import offer
from drs.arm_conversions import pose_sample
from drs.declare import Declared, declare
from drs.qos import LATCHED
from drs.run_node import run_node
from drs.state_conversions import joint_positions, joint_state, pose
from drs_core.errors import UsageError
from drs_core.serving.arm import ARM_IDS, read_arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.mock_arm import MockArm, TipControl

PARAMETERS = (
    Declared("arm_id", "panda", "which arm it is", allowed=ARM_IDS),
    Declared(
        "command_interface",
        "joint_command",
        "what moves it",
        allowed=("joint_command", "joint_trajectory", "target_pose"),
    ),
    Declared("command_period_s", 0.01, "time between two commands [s]", low=0.001, high=1.0),
    Declared("state_rate_hz", 100.0, "joint states and tip poses a second", low=10.0, high=1000.0),
    Declared("time_constant_s", 0.02, "lag of its joints [s]", low=0.001, high=1.0),
)
_TYPES = {"joint_command": JointState, "joint_trajectory": JointTrajectory, "target_pose": PoseStamped}


class MockArmNode(Node):
    """Wires a mock arm."""

    def __init__(self) -> None:
        """Begin at rest, in the neutral posture."""
        super().__init__("mock_arm_node")
        p = declare(self, PARAMETERS)
        self._arm = read_arm(p["arm_id"])
        # the elbow is pulled as it is by the policy node
        self._kinematics = Kinematics(self._arm, posture_gain=ServingConfig().posture_gain)
        self._period_s = 1.0 / p["state_rate_hz"]
        self._robot = MockArm(self._arm, self._arm.neutral_rad, p["command_period_s"], p["time_constant_s"])
        self._tip_control = TipControl(self._robot, self._kinematics)
        self._states = self.create_publisher(JointState, "joint_states", 1)
        self._tips = self.create_publisher(PoseStamped, "end_effector/pose", 1)
        self._reflexes, self._said = self.create_publisher(String, "reflex", LATCHED), None
        name = p["command_interface"]
        # deep enough for every command: one that is lost would look like a jump
        self.create_subscription(_TYPES[name], name, getattr(self, f"_on_{name}"), 100)
        offer(self, Trigger, "~/reset_reflex", self._reset, self.default_callback_group)
        self.create_timer(self._period_s, self._tick)
        self.get_logger().info("ready")

    def _on_joint_command(self, message: JointState) -> None:
        try:
            self._robot.command(joint_positions(message, self._arm.joints))
        except UsageError as error:
            self.get_logger().warning(str(error))

    def _on_joint_trajectory(self, message: JointTrajectory) -> None:
        if len(message.points) != 1:
            self.get_logger().warning(f"A trajectory has {len(message.points)} points; it takes those of one.")
            return
        self._on_joint_command(JointState(name=message.joint_names, position=message.points[0].positions))

    def _on_target_pose(self, message: PoseStamped) -> None:
        if message.header.frame_id != self._arm.base_frame:
            self.get_logger().warning(f"A pose is in {message.header.frame_id!r}, not in {self._arm.base_frame!r}.")
            return
        sample = pose_sample(message)
        self._tip_control.command(np.array(sample.position), np.array(sample.orientation))

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> None:
        self._robot.reset()
        self._tip_control.reset()

    def _tick(self) -> None:
        self._robot.advance(self._period_s)
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=self._arm.base_frame)
        q = self._robot.positions
        self._states.publish(joint_state(header, self._arm.joints, q, np.array(self._robot.velocities)))
        tip = self._kinematics.tip_position(q)
        self._tips.publish(pose(header, tip, self._kinematics.tip_orientation(q)))
        if self._robot.reflex != self._said:
            self._said = self._robot.reflex
            self._reflexes.publish(String(data=self._said))
            if self._said:
                self.get_logger().error(f"reflex: {self._said}")


def main() -> None:
    """Run the node."""
    run_node(MockArmNode)
