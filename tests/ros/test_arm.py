"""policy_node on an arm: it reaches goals over real topics, and a fault ends everything until it is reset."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from drs_interfaces.msg import PolicyStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import State, Transition
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from drs.qos import LATCHED
from drs.state_conversions import pose
from drs.state_input import reach_observation
from drs_core.actor import Actor
from drs_core.importing import resolve
from drs_core.panda import TIP_ORIENTATION, tip_target
from tests.ros.graph import Graph
from tests.ros.test_policy import change, state

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]


class Watched:
    """What the two nodes say."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.statuses: list[PolicyStatus] = []
        self.commands: list[JointState] = []
        self.trajectories: list[JointTrajectory] = []
        self.tips: list[np.ndarray] = []
        self.reflexes: list[str] = []
        listen = graph.client.create_subscription
        listen(PolicyStatus, "status", self.statuses.append, LATCHED)
        listen(JointState, "joint_command", self.commands.append, 100)
        listen(JointTrajectory, "joint_trajectory", self.trajectories.append, 100)
        listen(PoseStamped, "end_effector/pose", self._on_tip, 100)
        listen(String, "reflex", lambda message: self.reflexes.append(message.data), LATCHED)
        self._goals = graph.client.create_publisher(PoseStamped, "goal_pose", LATCHED)

    def _on_tip(self, message: PoseStamped) -> None:
        p = message.pose.position
        self.tips.append(np.array([p.x, p.y, p.z]))

    def send_goal(self, goal: tuple[float, float, float], frame: str = "panda_link0") -> None:
        message = PoseStamped()
        message.header.frame_id = frame
        message.pose.position.x, message.pose.position.y, message.pose.position.z = goal
        self._goals.publish(message)

    def wait_for(self, number: int, words: str = "") -> None:
        self.graph.wait(
            lambda: bool(self.statuses) and self.statuses[-1].state == number and words in self.statuses[-1].message,
            f"status {number} {words!r}, not {self.statuses[-1:]}",
        )


# a machine that is busy with other things: late inputs are what other tests are about
PATIENT = {"input_age_max_s": 2.0, "input_skew_max_s": 2.0, "clock_ahead_max_s": 1.0}


def test_it_reaches_goals_and_a_fault_ends_it_until_it_is_reset(graph: Graph) -> None:
    watched = Watched(graph)
    graph.start_ready("mock_arm_node")
    policy = graph.start_ready("policy_node", input="arm", autoconfigure=True, publish_joint_trajectory=True, **PATIENT)
    watched.wait_for(PolicyStatus.INACTIVE)
    graph.wait(lambda: bool(watched.tips), "the arm")
    watched.send_goal((0.6, 0.1, 0.25))
    assert not watched.commands and change(graph, Transition.TRANSITION_ACTIVATE)
    # before all others while it is active, or the log says why not
    assert (os.sched_getscheduler(policy.process.pid) == os.SCHED_FIFO) != policy.said("Without real-time priority 50")
    for goal in ((0.6, 0.1, 0.25), (0.5, -0.1, 0.15)):
        watched.send_goal(goal)
        graph.wait(lambda goal=goal: np.linalg.norm(watched.tips[-1] - goal) < 0.05, f"the tip at {goal}")
    assert all(command.name == JOINTS and len(command.position) == 7 for command in watched.commands)
    assert watched.trajectories[-1].joint_names == JOINTS and len(watched.trajectories[-1].points) == 1
    assert watched.trajectories[-1].points[0].time_from_start.nanosec == 10_000_000

    found: dict[str, str] = {}
    graph.client.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: found.update({v.key: v.value for v in m.status[0].values}), 10
    )
    graph.wait(lambda: float(found.get("latency, median [ms]", 0.0)) > 0.0 and "missed periods" in found, "figures")

    watched.send_goal((0.6, 0.0, -0.3))
    watched.wait_for(PolicyStatus.HOLDING, "goal is outside")
    watched.send_goal((0.6, 0.0, 0.2))
    watched.wait_for(PolicyStatus.ACTING)
    watched.send_goal((0.6, 0.0, 0.2), frame="world")
    watched.wait_for(PolicyStatus.FAULT, "'world', not in 'panda_link0'")
    # what was under way arrives, and nothing after it
    seen = len(watched.tips) + 30
    graph.wait(lambda: len(watched.tips) > seen, "a third of a second")
    count = len(watched.commands)
    watched.send_goal((0.6, 0.0, 0.2))
    graph.wait(lambda: len(watched.tips) > seen + 50, "half a second more")
    assert len(watched.commands) == count and watched.statuses[-1].state == PolicyStatus.FAULT

    assert change(graph, Transition.TRANSITION_DEACTIVATE)
    assert os.sched_getscheduler(policy.process.pid) == os.SCHED_OTHER
    assert not change(graph, Transition.TRANSITION_ACTIVATE) and not change(graph, Transition.TRANSITION_CLEANUP)
    assert policy.said("reset it first")
    answer = graph.call(Trigger, "policy_node/reset_fault")
    assert answer.success and "'world'" in answer.message
    watched.wait_for(PolicyStatus.INACTIVE)
    assert len(watched.commands) == count
    assert not graph.call(Trigger, "policy_node/reset_fault").success
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    watched.wait_for(PolicyStatus.ACTING)
    assert watched.reflexes == [""], watched.reflexes
    assert not policy.said("Traceback")


@pytest.mark.parametrize("topic", ["joint_command", "target_joint"])
def test_another_publisher_of_commands_is_a_fault_and_reset_leaves_it_inactive(graph: Graph, topic: str) -> None:
    watched, remaps = Watched(graph), [f"joint_command:={topic}"]
    graph.start_ready("mock_arm_node", remaps=remaps)
    graph.start_ready("policy_node", remaps=remaps, input="arm", autoconfigure=True, **PATIENT)
    watched.send_goal((0.6, 0.1, 0.25))
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    watched.wait_for(PolicyStatus.ACTING)
    other = graph.client.create_publisher(JointState, topic, 1)
    watched.wait_for(PolicyStatus.FAULT, f"{topic} has 2 publishers")
    assert graph.call(Trigger, "policy_node/reset_fault").success
    watched.wait_for(PolicyStatus.INACTIVE)
    assert state(graph) == State.PRIMARY_STATE_INACTIVE
    # nor does it begin beside one that is there already
    commands: list[JointState] = []
    graph.client.create_subscription(JointState, topic, commands.append, 100)
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    watched.wait_for(PolicyStatus.FAULT, f"{topic} has 2 publishers")
    seen = len(watched.tips) + 50
    graph.wait(lambda: len(watched.tips) > seen, "half a second")
    assert not commands
    graph.client.destroy_publisher(other)


def test_after_a_stall_in_mid_motion_it_begins_anew_from_rest(graph: Graph) -> None:
    watched = Watched(graph)
    graph.start_ready("mock_arm_node")
    policy = graph.start_ready("policy_node", input="arm", autoconfigure=True, **PATIENT)
    watched.send_goal((0.6, 0.2, 0.35))
    assert change(graph, Transition.TRANSITION_ACTIVATE)

    def moving() -> bool:
        last = [np.array(command.position) for command in watched.commands[-2:]]
        return len(last) == 2 and float(np.abs(last[1] - last[0]).max()) > 0.003

    graph.wait(moving, "the middle of a motion")
    policy.send(signal.SIGSTOP)
    seen = len(watched.tips) + 50
    graph.wait(lambda: len(watched.tips) > seen, "half a second")
    policy.send(signal.SIGCONT)
    graph.wait(lambda: policy.said("Commands were interrupted"), "the gap to be found")
    graph.wait(lambda: np.linalg.norm(watched.tips[-1] - (0.6, 0.2, 0.35)) < 0.05, "the goal")
    assert watched.reflexes == [""], watched.reflexes


def test_its_clock_stays_while_it_is_configured(graph: Graph) -> None:
    node = graph.start_ready("policy_node", input="arm", autoconfigure=True)
    other = Parameter("use_sim_time", value=True).to_parameter_msg()

    def set_it() -> SetParametersResult:
        return graph.call(
            SetParameters, "policy_node/set_parameters", SetParameters.Request(parameters=[other])
        ).results[0]

    refused = set_it()
    assert not refused.successful and "clean up first" in refused.reason
    assert change(graph, Transition.TRANSITION_CLEANUP) and set_it().successful and not node.said("Traceback")


def test_what_could_not_be_configured_leaves_nothing_on_the_graph(graph: Graph) -> None:
    graph.start_ready("policy_node", input="state", agent="panda_push")
    for _ in range(3):
        assert not change(graph, Transition.TRANSITION_CONFIGURE)
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert not graph.client.count_publishers("action") and not graph.client.count_subscribers("goal_pose")


def test_an_arm_is_never_moved_by_a_start_alone(graph: Graph) -> None:
    node = graph.start("policy_node", input="arm", autostart=True)
    assert node.process.wait(timeout=30) == 2
    assert node.said("autostart does not go with the input arm") and not node.said("Traceback")


def test_what_cannot_be_served_is_refused(graph: Graph) -> None:
    watched = Watched(graph)
    wrong = {
        "not agent_digest abab": {"input": "arm", "agent_digest": "ab" * 32},
        "with the input arm": {"arm_id": "fr3"},
        "HopperBulletEnv-v0 cannot be served to an arm": {"input": "arm", "agent": "hopper_td3"},
    }
    for number, (words, parameters) in enumerate(wrong.items()):
        node = graph.start("policy_node", f"policy_{number}", autoconfigure=True, **parameters)
        watched.wait_for(PolicyStatus.UNCONFIGURED, words)
        assert not node.said("Traceback")
        node.kill()
    node = graph.start("policy_node", "policy_last", input="arm", autoconfigure=True, velocity_scale=0.001)
    assert node.process.wait(timeout=30) == 2 and node.said("velocity_scale") and not node.said("Traceback")


INTERFACES = ("joint_command", "joint_trajectory", "target_pose")


@pytest.mark.parametrize("interface", INTERFACES)
def test_the_mock_arm_is_driven_to_twenty_goals_without_a_reflex(graph: Graph, interface: str) -> None:
    watched, rng = Watched(graph), np.random.default_rng(INTERFACES.index(interface))
    graph.start_ready("mock_arm_node", command_interface=interface)
    graph.wait(lambda: bool(watched.tips), "the arm")
    outputs = {f"publish_{name}": name == interface for name in INTERFACES}
    velocity = "pose" if interface == "joint_trajectory" else "joints"
    graph.start_ready("policy_node", input="arm", autoconfigure=True, tip_velocity=velocity, **outputs, **PATIENT)
    watched.send_goal((0.6, 0.1, 0.25))
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    for goal in rng.uniform((0.45, -0.15, 0.05), (0.7, 0.15, 0.3), (20, 3)):
        watched.send_goal(tuple(goal.tolist()))
        graph.wait(lambda goal=goal: np.linalg.norm(watched.tips[-1] - goal) < 0.05, f"the tip at {goal}")
    assert watched.reflexes == [""] and watched.statuses[-1].state == PolicyStatus.ACTING


def test_the_same_policy_without_guards_trips_it(graph: Graph) -> None:
    watched, actor = Watched(graph), Actor(resolve("panda_reach"))
    graph.start_ready("mock_arm_node", command_interface="target_pose", command_period_s=0.04)
    raw, goal = graph.client.create_publisher(PoseStamped, "target_pose", 10), np.array((0.6, 0.1, 0.25))
    graph.wait(lambda: bool(watched.tips) and raw.get_subscription_count() > 0, "the arm")
    sent = []

    def act() -> None:
        tip = watched.tips[-1]
        action = actor.act(reach_observation(tip, np.zeros(3), goal), len(sent))
        sent.append(tip_target(action, tip))
        raw.publish(pose(Header(frame_id="panda_link0"), sent[-1], TIP_ORIENTATION))

    graph.client.create_timer(0.04, act)
    graph.wait(lambda: bool(watched.reflexes and watched.reflexes[-1]), "a reflex")
    assert "above its limit" in watched.reflexes[-1] and len(sent) < 25
