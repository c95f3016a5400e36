"""policy_node answers a transition that its state does not have; rclpy alone ends the process with a traceback."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drs_interfaces.msg import Action, Observation
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState

from tests.ros.graph import Graph, NodeProcess
from tests.ros.test_policy import change, observation, state

ALLOWED = {
    State.PRIMARY_STATE_UNCONFIGURED: {"configure": 1, "shutdown": 5},
    State.PRIMARY_STATE_INACTIVE: {"cleanup": 2, "activate": 3, "shutdown": 6},
    State.PRIMARY_STATE_ACTIVE: {"deactivate": 4, "shutdown": 7},
    State.PRIMARY_STATE_FINALIZED: {},
}
LABELS = {label for allowed in ALLOWED.values() for label in allowed} | {"transition_success", "fly", "\x1b[2J"}


def refusals(node: NodeProcess) -> list[str]:
    return [line for line in node.log.read_text().splitlines() if "change_state: " in line]


def refuses_all_others(graph: Graph, node: NodeProcess, where: int) -> None:
    """Every other id and label is answered, told of once, and changes nothing."""
    assert state(graph) == where
    wrong = [Transition(id=number) for number in range(256) if number not in ALLOWED[where].values()]
    # the label counts where there is one
    wrong += [Transition(id=next(iter(ALLOWED[where].values()), 0), label=la) for la in LABELS - set(ALLOWED[where])]
    asking, looking = (graph.client.create_client(k, f"policy_node/{n}") for k, n in
                       ((ChangeState, "change_state"), (GetState, "get_state")))  # fmt: skip
    graph.wait(lambda: asking.service_is_ready() and looking.service_is_ready(), "the services")
    # a node that has answered this one knows the clients that were made before it
    assert state(graph) == where
    before = len(refusals(node))
    for number, transition in enumerate(wrong, 1):
        answer = graph.finish(asking.call_async(ChangeState.Request(transition=transition)), f"{transition}")
        assert not answer.success, transition
        assert graph.finish(looking.call_async(GetState.Request()), "the state").current_state.id == where
        assert len(refusals(node)) == before + number, transition
    for client in (asking, looking):
        graph.client.destroy_client(client)


@pytest.mark.parametrize("source", ["observation", "arm"])
def test_a_transition_that_a_state_does_not_have_is_refused(graph: Graph, source: str) -> None:
    node = graph.start_ready("policy_node", input=source)
    refuses_all_others(graph, node, State.PRIMARY_STATE_UNCONFIGURED)
    assert "WARN" in refusals(node)[0] and "[policy_node]" in refusals(node)[0]
    assert change(graph, Transition.TRANSITION_CONFIGURE)
    refuses_all_others(graph, node, State.PRIMARY_STATE_INACTIVE)
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    refuses_all_others(graph, node, State.PRIMARY_STATE_ACTIVE)
    said = "the transition 3 (activate) is not allowed in the state active; allowed are deactivate (4), shutdown (7)."
    assert node.said(said) and node.said("the transition 200 (unknown) is not allowed in the state active")
    assert node.said("the transition 'fly' is not") and node.said(r"\x1b[2J") and not node.said("\x1b[2J")

    assert change(graph, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    refuses_all_others(graph, node, State.PRIMARY_STATE_FINALIZED)
    assert node.said("the transition 1 (configure) is not allowed in the state finalized; none is.")
    assert not node.said("Traceback") and node.interrupt()[0] == 0


def test_a_refusal_leaves_it_serving(graph: Graph) -> None:
    actions: list[Action] = []
    graph.client.create_subscription(Action, "action", actions.append, 10)
    publisher = graph.client.create_publisher(Observation, "observation", 10)
    graph.start_ready("policy_node", autostart=True)
    graph.wait(lambda: publisher.get_subscription_count() == 1, "the subscription")
    assert not change(graph, Transition.TRANSITION_ACTIVATE)
    publisher.publish(observation(np.zeros(12), number=5))
    graph.wait(lambda: bool(actions), "an action")
    assert actions[0].observation == 5


def test_labels_do_what_ids_do(graph: Graph) -> None:
    graph.start_ready("policy_node")
    for label, where in (
        ("configure", State.PRIMARY_STATE_INACTIVE),
        ("activate", State.PRIMARY_STATE_ACTIVE),
        ("deactivate", State.PRIMARY_STATE_INACTIVE),
        ("cleanup", State.PRIMARY_STATE_UNCONFIGURED),
        ("shutdown", State.PRIMARY_STATE_FINALIZED),
    ):
        request = ChangeState.Request(transition=Transition(label=label))
        assert graph.call(ChangeState, "policy_node/change_state", request).success, label
        assert state(graph) == where


def test_autostart_without_its_agent_leaves_it_unconfigured(graph: Graph, tmp_path: Path) -> None:
    agent = tmp_path / "later.safetensors"
    node = graph.start_ready("policy_node", autostart=True, agent=agent)
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED and node.said("There is no agent file")
    assert not change(graph, Transition.TRANSITION_ACTIVATE)
    assert not change(graph, Transition.TRANSITION_CONFIGURE) and not node.said("Traceback")


BUGGY = """
from drs.policy_node import PolicyNode
from drs.run_node import run_node


class Buggy(PolicyNode):
    def on_activate(self, state):
        raise RuntimeError("a bug")


run_node(Buggy)
"""


def test_a_transition_with_a_bug_takes_the_agent_off_the_graph(graph: Graph, tmp_path: Path) -> None:
    program = tmp_path / "buggy.py"
    program.write_text(BUGGY)
    node = graph.start_ready(str(program), "policy_node", input="arm")
    for _ in range(2):
        assert change(graph, Transition.TRANSITION_CONFIGURE)
        graph.wait(lambda: graph.client.count_publishers("joint_command") == 1, "its publisher, once")
        assert not change(graph, Transition.TRANSITION_ACTIVATE)
        assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
        graph.wait(lambda: graph.client.count_publishers("joint_command") == 0, "its publisher's end", 10.0)
    assert node.said("failed inside the node")
