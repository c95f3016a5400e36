"""The SROS2 policy is what its generator makes, is of the documented schema, and covers what nodes really have."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from tests.ros.graph import ROOT, Graph
from tests.ros.test_docs import script

POLICY = ROOT / "ros_ws" / "security" / "policy.xml"
PERMISSIONS = {
    "topics": ("topic", {"publish", "subscribe"}),
    "services": ("service", {"reply", "request"}),
    "actions": ("action", {"call", "execute"}),
}
ACTION_ENDS = {"services": ("send_goal", "get_result", "cancel_goal"), "topics": ("feedback", "status")}
DIRECTIONS = {"publish": "execute", "reply": "execute", "subscribe": "call", "request": "call"}


def children(element: ET.Element, tag: str, *attributes: str) -> list[ET.Element]:
    """Its children, at least one, all of this tag, each with these attributes and no other."""
    found = list(element)
    assert found and {child.tag for child in found} == {tag}, element.tag
    assert all(set(child.attrib) == set(attributes) for child in found), tag
    return found


def test_the_file_is_the_newest() -> None:
    generator = script("security_policy")
    assert POLICY.read_text() == generator.policy(generator.PAGE.read_text())


def test_the_file_is_of_the_documented_schema() -> None:
    # policy.xsd of version 0.2.0: https://design.ros2.org/articles/ros2_access_control_policies.html
    root = ET.parse(POLICY).getroot()
    assert root.tag == "policy" and root.attrib == {"version": "0.2.0"}
    (listed,) = children(root, "enclaves")
    paths = []
    for enclave in children(listed, "enclave", "path"):
        paths.append(enclave.attrib["path"])
        for profiles in children(enclave, "profiles"):
            for profile in children(profiles, "profile", "ns", "node"):
                for rule in profile:
                    tag, allowed = PERMISSIONS[rule.tag]
                    assert (
                        rule.attrib and set(rule.attrib) <= allowed and set(rule.attrib.values()) <= {"ALLOW", "DENY"}
                    )
                    names = [entry.text for entry in children(rule, tag)]
                    assert all(names) and len(set(names)) == len(names)
    assert len(set(paths)) == len(paths) == 6


def allowed(node: str, kind: str, permission: str) -> list[str]:
    """Names, resolved, that a node's profile allows."""
    found = []
    for profile in ET.parse(POLICY).getroot().iterfind(f".//profile[@node='{node}']"):
        for name in profile.iterfind(f"{kind}[@{permission}='ALLOW']/*"):
            text = name.text or ""
            found.append(f"/{node}{text[1:]}" if text.startswith("~") else text if text.startswith("/") else f"/{text}")
        for action in profile.iterfind(f"actions[@{DIRECTIONS[permission]}='ALLOW']/*"):
            found += [f"/{(action.text or '').strip('/')}/_action/{end}" for end in ACTION_ENDS[kind]]
    return found


def uses(graph: Graph, node: str) -> dict[tuple[str, str], set[str]]:
    """What a running node has, as far as it has been found: by kind and permission."""
    graph.wait(lambda: (node, "/") in graph.client.get_node_names_and_namespaces(), node)
    queries = {
        ("topics", "publish"): graph.client.get_publisher_names_and_types_by_node,
        ("topics", "subscribe"): graph.client.get_subscriber_names_and_types_by_node,
        ("services", "reply"): graph.client.get_service_names_and_types_by_node,
        ("services", "request"): graph.client.get_client_names_and_types_by_node,
    }
    return {key: {name for name, _ in query(node, "/")} for key, query in queries.items()}


def is_covered(graph: Graph, nodes: list[str]) -> int:
    """Check that each node is allowed what it has; how many names were looked at."""
    count = 0
    for node in nodes:
        graph.wait(
            lambda node=node: f"/{node}/get_parameters" in uses(graph, node)["services", "reply"], f"all of {node}"
        )
        for (kind, permission), names in uses(graph, node).items():
            patterns = allowed(node, kind, permission)
            missing = {name for name in names if not any(fnmatchcase(name, pattern) for pattern in patterns)}
            assert not missing, (node, kind, permission, missing)
            count += len(names)
    return count


def test_simulation_and_tuning_are_covered(graph: Graph, tmp_path: Path) -> None:
    graph.start_ready("simulator_node")
    graph.start_ready("simulator_node", "simulator_2", stream=False)
    graph.start_ready("policy_node", autoconfigure=True)
    graph.start_ready("recorder_node", output=tmp_path / "x.mcap")
    # it looks for simulators again before every update, until it has the clients of both
    run = {"updates": 10_000, "directions": 1, "evaluate_every": 0, "output": tmp_path / "run"}
    tuner = graph.start_ready("tuner_node", autostart=True, **run)
    graph.wait(lambda: tuner.said("update 1/"), "an update")
    asked = {"/simulator_node/run_episodes", "/simulator_2/run_episodes"}
    graph.wait(lambda: asked <= uses(graph, "tuner_node")["services", "request"], "the tuner's clients")
    assert is_covered(graph, ["simulator_node", "simulator_2", "policy_node", "recorder_node", "tuner_node"]) > 80


@pytest.mark.parametrize("moved_by", ["joint_command", "joint_trajectory", "target_pose"])
def test_an_arm_is_covered(graph: Graph, moved_by: str) -> None:
    simulator = moved_by if moved_by != "joint_trajectory" else "action"
    published = {f"publish_{topic}": True for topic in ("joint_command", "joint_trajectory", "target_pose", "steps")}
    graph.start_ready("mock_arm_node", command_interface=moved_by)
    graph.start_ready("simulator_node", command_interface=simulator)
    graph.start_ready("policy_node", input="arm", autoconfigure=True, **published)
    shown = {"/reflex", "/joint_states"}
    graph.wait(lambda: shown <= uses(graph, "mock_arm_node")["topics", "publish"], "the arm's topics")
    assert is_covered(graph, ["mock_arm_node", "simulator_node", "policy_node"]) > 50


def test_an_operator_may_ask_every_service_that_our_nodes_offer() -> None:
    root = ET.parse(POLICY).getroot()
    nodes = [profile.attrib["node"] for profile in root.iterfind(".//profile") if profile.attrib["node"] != "operator"]
    offered = {name for node in nodes for name in allowed(node, "services", "reply") if "_action/" not in name}
    assert offered <= set(allowed("operator", "services", "request"))
    assert {"/policy_node/change_state", "/evaluate"} <= offered
