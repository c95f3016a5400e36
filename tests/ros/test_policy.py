"""policy_node: its life cycle, its answers, and what it refuses."""

from __future__ import annotations

import array
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from drs_interfaces.msg import Action, Observation, PolicyStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from sensor_msgs.msg import JointState

from drs_core.environments import Environment
from drs_core.importing import resolve
from tests.ros.graph import Graph


def change(graph: Graph, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return graph.call(ChangeState, "policy_node/change_state", request).success


def state(graph: Graph) -> int:
    return graph.call(GetState, "policy_node/get_state", repeat_s=2.0).current_state.id


def observation(values: np.ndarray, number: int = 1) -> Observation:
    sizes = array.array("I", [3, 3, 6])
    keys = ["achieved_goal", "desired_goal", "observation"]
    return Observation(number=number, keys=keys, sizes=sizes, values=array.array("d", values.tolist()))


def test_it_answers_only_while_it_is_active(graph: Graph) -> None:
    actions: list[Action] = []
    graph.client.create_subscription(Action, "action", actions.append, 10)
    publisher = graph.client.create_publisher(Observation, "observation", 10)
    graph.start_ready("policy_node")
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert change(graph, Transition.TRANSITION_CONFIGURE)
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    graph.wait(lambda: publisher.get_subscription_count() == 1, "the subscription")

    agent = resolve("panda_reach")
    environment = Environment(agent.environment)
    seen = environment.reset(4)
    environment.close()
    flat = np.concatenate([seen[key] for key in sorted(seen)]).astype(np.float64)
    publisher.publish(observation(flat, number=17))
    graph.wait(lambda: bool(actions), "an action")
    expected = agent.policy().act(agent.assembler().features(seen, 0))
    assert actions[0].observation == 17
    assert np.array_equal(np.array(actions[0].values, np.float32), expected)

    assert change(graph, Transition.TRANSITION_DEACTIVATE)
    publisher.publish(observation(flat, number=18))
    assert change(graph, Transition.TRANSITION_CLEANUP)
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert [action.observation for action in actions] == [17]
    assert change(graph, Transition.TRANSITION_CONFIGURE) and change(graph, Transition.TRANSITION_ACTIVATE)


def test_what_it_cannot_answer_is_said_and_counted(graph: Graph) -> None:
    statuses: list[PolicyStatus] = []
    diagnostics: list[DiagnosticArray] = []
    graph.client.create_subscription(PolicyStatus, "status", statuses.append, 10)
    graph.client.create_subscription(DiagnosticArray, "/diagnostics", diagnostics.append, 10)
    publisher = graph.client.create_publisher(Observation, "observation", 10)
    node = graph.start_ready("policy_node", autostart=True)
    graph.wait(lambda: publisher.get_subscription_count() == 1, "the subscription")
    wrong = observation(np.zeros(12))
    wrong.sizes = array.array("I", [3, 3, 7])
    for message, words in (
        (observation(np.full(12, np.nan)), "not finite"),
        (observation(np.zeros(11)), "11 values"),
        (wrong, "12 values"),
        (Observation(keys=["observation"], sizes=array.array("I", [2]), values=array.array("d", [0.0, 0.0])), "parts"),
    ):
        statuses.clear()
        publisher.publish(message)
        graph.wait(lambda: bool(statuses), "a status")
        assert statuses[0].state == PolicyStatus.REFUSING and words in statuses[0].message
    publisher.publish(observation(np.zeros(12)))
    graph.wait(lambda: statuses[-1].state == PolicyStatus.ACTING, "an answer after all")
    assert (statuses[-1].refused, statuses[-1].answered) == (4, 1)
    graph.wait(lambda: any("policy" in array_.status[0].name for array_ in diagnostics), "diagnostics")
    assert not node.said("Traceback")


def test_an_unknown_agent_leaves_it_unconfigured(graph: Graph, tmp_path: Path) -> None:
    node = graph.start_ready("policy_node", agent=tmp_path / "none.safetensors")
    assert not change(graph, Transition.TRANSITION_CONFIGURE)
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert node.said("There is no agent file") and not node.said("Traceback")


def test_in_real_time_it_commands_the_seven_joints_of_the_arm(graph: Graph) -> None:
    commands: list[JointState] = []
    poses: list[PoseStamped] = []
    graph.client.create_subscription(JointState, "joint_command", commands.append, 10)
    graph.client.create_subscription(PoseStamped, "target_pose", poses.append, 10)
    graph.start_ready("simulator_node", command_interface="joint_command")
    graph.start_ready("policy_node", autostart=True)
    graph.wait(lambda: len(commands) > 60 and len(poses) > 60, "two seconds of commands")
    assert all(list(command.name) == [f"panda_joint{i}" for i in range(1, 8)] for command in commands)
    assert all(pose.header.frame_id == "panda_link0" for pose in poses)
