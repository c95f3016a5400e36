"""What goes wrong around policy_node: for each the state, the sentence, and nothing published after it.

The drivers are played here, on simulated time, so that nothing depends on how busy the machine is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from drs_interfaces.msg import PolicyStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from drs.qos import LATCHED
from drs.state_conversions import joint_state, pose, stamp
from drs_core.serving.arm import read_arm
from drs_core.serving.kinematics import Kinematics
from tests.ros.graph import Graph
from tests.ros.test_policy import change

PERIOD_S = 0.01
FINE = (0.6, 0.1, 0.25)


class Drivers:
    """Clock, joint states and tip pose of an arm that is always where it was last told to be."""

    def __init__(self, graph: Graph) -> None:
        self.graph, self.arm = graph, read_arm("panda")
        self.kinematics, self.now_s = Kinematics(self.arm), 1000.0
        self.positions, self.commands = self.arm.neutral_rad, 0
        self.statuses: list[PolicyStatus] = []
        publish, listen = graph.client.create_publisher, graph.client.create_subscription
        self.clock = publish(Clock, "/clock", 10)
        self.joints = publish(JointState, "joint_states", 10)
        self.tip = publish(PoseStamped, "end_effector/pose", 10)
        self.goal = publish(PoseStamped, "goal_pose", LATCHED)
        listen(PolicyStatus, "status", self.statuses.append, LATCHED)
        listen(JointState, "joint_command", self._on_command, 100)

    def _on_command(self, message: JointState) -> None:
        self.positions, self.commands = np.array(message.position), self.commands + 1

    def send_goal(self, position: tuple[float, float, float] = FINE, frame: str = "panda_link0") -> None:
        self.goal.publish(pose(Header(frame_id=frame), np.array(position), (1.0, 0.0, 0.0, 0.0)))

    def tick(self, spoil: Callable[[JointState, PoseStamped], Any] | None = None, floods: int = 1) -> None:
        self.now_s += PERIOD_S
        header = Header(stamp=stamp(self.now_s), frame_id="panda_link0")
        joints = joint_state(header, self.arm.joints, self.positions, np.zeros(7))
        tip = pose(header, self.kinematics.tip_position(self.positions), (1.0, 0.0, 0.0, 0.0))
        if spoil is not None:
            spoil(joints, tip)
        self.clock.publish(Clock(clock=stamp(self.now_s)))
        for _ in range(floods):
            self.joints.publish(joints)
            self.tip.publish(tip)
        for _ in range(3):
            self.graph._executor.spin_once(timeout_sec=0.003)

    def until(self, number: int, words: str = "", spoil: Any = None) -> None:
        for _ in range(2000):
            if self.statuses and self.statuses[-1].state == number and words in self.statuses[-1].message:
                break
            self.tick(spoil)
        newest = self.statuses[-1] if self.statuses else None
        said = "\n".join(node.log.read_text()[-2000:] for node in self.graph.nodes)
        assert newest is not None and newest.state == number and words in newest.message, (words, newest, said)

    def quiet(self, ticks: int = 40) -> None:
        """What was under way arrives, and then nothing, whatever comes in."""
        for _ in range(20):
            self.tick()
        count = self.commands
        for _ in range(ticks):
            self.tick()
        assert self.commands == count


def setting(name: str, value: Any) -> Callable[[JointState, PoseStamped], None]:
    return lambda joints, tip: setattr(joints, name, value(getattr(joints, name)))


def spoiled(index: int, value: float) -> Callable[[Any], Any]:
    return lambda values: [*values[:index], value, *values[index + 1 :]]


def without_last(joints: JointState, tip: PoseStamped) -> None:
    joints.name, joints.position, joints.velocity = joints.name[:-1], joints.position[:-1], joints.velocity[:-1]


def old(joints: JointState, tip: PoseStamped) -> None:
    joints.header.stamp.sec -= 5
    tip.header.stamp = joints.header.stamp


def elsewhere(joints: JointState, tip: PoseStamped) -> None:
    tip.pose.position.x += 0.1


def pose_value(axis: str, value: float) -> Callable[[JointState, PoseStamped], None]:
    return lambda joints, tip: setattr(tip.pose.position, axis, value)


def turned(joints: JointState, tip: PoseStamped) -> None:
    tip.pose.orientation.x = 0.5


def elsewhere_frame(joints: JointState, tip: PoseStamped) -> None:
    tip.header.frame_id = "world"


def ahead(joints: JointState, tip: PoseStamped) -> None:
    joints.header.stamp.sec += 5


def twice(joints: JointState, tip: PoseStamped) -> None:
    joints.name = [*joints.name, joints.name[0]]
    joints.position, joints.velocity = [*joints.position, 0.0], [*joints.velocity, 0.0]


FAULTS = {
    "joint NaN": (setting("position", spoiled(2, float("nan"))), "panda_joint3"),
    "joint inf": (setting("velocity", spoiled(0, float("inf"))), "panda_joint1"),
    "joint missing": (without_last, "lack panda_joint7"),
    "joints under other names": (setting("name", lambda names: names[::-1]), "contradict"),
    "joint twice": (twice, "panda_joint1 more than once"),
    "joint positions of another number": (setting("position", lambda values: values[:-1]), "6 positions"),
    "tip NaN": (pose_value("y", float("nan")), "The tip pose is not"),
    "tip inf": (pose_value("z", float("inf")), "The tip pose is not"),
    "tip orientation": (turned, "norm 0.5"),
    "tip in another frame": (elsewhere_frame, "'world'"),
    "tip elsewhere": (elsewhere, "contradict"),
    "joints of the future": (ahead, "ahead"),
}


def test_every_fault_ends_it_until_it_is_reset_and_a_doubt_holds_it(graph: Graph) -> None:
    drivers = Drivers(graph)
    node = graph.start("policy_node", input="arm", autoconfigure=True, use_sim_time=True)
    drivers.send_goal()
    drivers.until(PolicyStatus.INACTIVE)
    drivers.quiet(10)
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    drivers.until(PolicyStatus.ACTING)

    for name, (spoil, words) in FAULTS.items():
        drivers.until(PolicyStatus.FAULT, words, spoil)
        drivers.quiet()
        assert graph.call(Trigger, "policy_node/reset_fault").success, name
        drivers.until(PolicyStatus.INACTIVE)
        drivers.quiet(10)
        assert change(graph, Transition.TRANSITION_ACTIVATE), name
        drivers.until(PolicyStatus.ACTING)

    def permuted(joints: JointState, tip: PoseStamped) -> None:
        joints.name, joints.position, joints.velocity = joints.name[::-1], joints.position[::-1], joints.velocity[::-1]

    count = drivers.commands
    for _ in range(50):
        drivers.tick(permuted)
    assert drivers.statuses[-1].state == PolicyStatus.ACTING and drivers.commands > count

    count = drivers.commands
    for _ in range(50):
        drivers.tick(floods=10)
    assert drivers.statuses[-1].state == PolicyStatus.ACTING and 0 < drivers.commands - count <= 60

    drivers.until(PolicyStatus.HOLDING, "too old", old)
    drivers.until(PolicyStatus.ACTING)
    drivers.send_goal((0.6, 0.0, -0.5))
    drivers.until(PolicyStatus.HOLDING, "goal is outside")
    drivers.quiet()
    drivers.send_goal()
    drivers.until(PolicyStatus.ACTING)

    drivers.now_s -= 100.0
    drivers.until(PolicyStatus.FAULT, "It went back")
    drivers.quiet()
    assert not node.said("Traceback")

    # another process begins where every one does, whatever the last one was doing
    node.kill()
    graph.start("policy_node", "policy_again", input="arm", autoconfigure=True, use_sim_time=True)
    drivers.statuses.clear()
    drivers.until(PolicyStatus.INACTIVE)
    drivers.quiet()


def test_a_task_with_an_object_needs_its_pose(graph: Graph) -> None:
    drivers = Drivers(graph)
    objects = graph.client.create_publisher(PoseStamped, "object_pose", 10)

    def at(x: float) -> Callable[[JointState, PoseStamped], None]:
        return lambda joints, tip: objects.publish(pose(tip.header, np.array((x, 0.0, 0.02)), (0.0, 0.0, 0.0, 1.0)))

    node = graph.start("policy_node", input="arm", agent="panda_push", autoconfigure=True, use_sim_time=True)
    drivers.send_goal((0.65, 0.05, 0.02))
    drivers.until(PolicyStatus.INACTIVE)
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    drivers.until(PolicyStatus.WAITING, "object's pose or velocity is missing")
    drivers.quiet(10)
    drivers.until(PolicyStatus.ACTING, spoil=at(0.6))
    drivers.until(PolicyStatus.HOLDING, "object pose")
    drivers.until(PolicyStatus.ACTING, spoil=at(0.6))
    drivers.until(PolicyStatus.FAULT, "The object pose is not", at(float("nan")))
    drivers.quiet()
    assert not node.said("Traceback")
