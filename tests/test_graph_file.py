"""A parameter file of a graph is refused where it names what no node has."""

from __future__ import annotations

from pathlib import Path

import pytest

from drs_core.errors import UsageError
from drs_core.graph import GraphConfig
from drs_core.graph_file import check_graph_file
from drs_core.node_parameters import check_given

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("path", sorted((ROOT / "params").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_files_that_come_along_are_fine(path: Path) -> None:
    check_graph_file(path)


FINE = """
/**:
  ros__parameters:
    use_sim_time: false
    start_type_description_service: true
    qos_overrides: {/parameter_events: {publisher: {depth: 10}}}
    environment: PandaReach-v3       # simulator_node's
    objective: smooth                # tuner_node's
    velocity_scale: 0.3              # policy_node's
    topics: /action                  # recorder_node's
    time_constant_s: 0.02            # mock_arm_node's
    robot_description: <robot/>      # others'
    diagnostic_updater: {period: 1.0}
    update_rate: 100
simulator_7: {ros__parameters: {stream: false}}
/cell/policy_node: {ros__parameters: {qos_overrides./action.publisher.depth: 3}}
cell: {tuner_node: {ros__parameters: {updates: 3}}, mock_arm_node: {ros__parameters: }}
camera_node: {ros__parameters: {exposure: 3, lens.k: [1.0, 2.0]}}
recorder: {ros__parameters: {record.all_topics: true}}
gz: {simulator: {ros__parameters: {physics: ode}}}
policy_node_2: {ros__parameters: {agent: panda_push}}
joint_trajectory_controller: {ros__parameters: {gains: {j1: {p: 1.0}}}}
"""


def test_what_some_node_has_may_stand_in_the_section_of_all(tmp_path: Path) -> None:
    path = tmp_path / "fine.yaml"
    path.write_text(FINE)
    assert GraphConfig(path).params == path


WRONG = {
    "tuner_node: {ros__parameters: {updaets: 3}}": "'tuner_node' sets 'updaets', which tuner_node does not have; "
    "did you mean 'updates'?",
    "/tuner_node: {ros__parameters: {environment: x}}": "'/tuner_node' sets 'environment', which tuner_node does not",
    "simulator_2: {ros__parameters: {steam: true}}": "which simulator_node does not have; did you mean 'stream'?",
    "policy_node: {ros__parameters: {velocity_scael: 0.1}}": "did you mean 'velocity_scale'?",
    "cell: {policy_node: {ros__parameters: {inptu: arm}}}": "'cell/policy_node' sets 'inptu'",
    "mock_arm_node: {ros__parameters: {armid: fr3}}": "did you mean 'arm_id'?",
    "recorder_node: {ros__parameters: {ouput: x}}": "did you mean 'output'?",
    "/**: {ros__parameters: {agnet: panda_reach}}": "which no node of drs has; did you mean 'agent'?",
    "tuner_node: {ros__parameters: {xyzzy: 1}}": "which tuner_node does not have; docs/ros.md lists them.",
    "tuner_node: {ros__parameters: {alpha: {first: 1.0}}}": "sets 'alpha.first'",
    "tuner_node: {ros__parameters: {1: 2}}": "sets '1'",
    "tuner_nod: {ros__parameters: {updates: 3}}": "'tuner_nod' is for no node of drs; did you mean 'tuner_node'?",
    "mock_arm: {ros__parameters: {arm_id: fr3}}": "did you mean 'mock_arm_node'?",
    "tuner_node: {updates: 3}": "'updates' stands where node names",
    "tuner_node: {ros__parameters: 3}": "'ros__parameters' stands where node names",
    "ros__parameters: {updates: 3}": "'ros__parameters' stands where node names",
    "": "does not hold node names",
    "[1, 2]": "does not hold node names",
    "tuner_node: {": "is not a readable YAML file",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_its_node_does_not_have_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    with pytest.raises(UsageError) as caught:
        GraphConfig(path)
    assert WRONG[text] in str(caught.value) and str(path) in str(caught.value)


def test_a_node_takes_what_it_has_or_another_or_ros() -> None:
    check_given(["updates", "velocity_scale", "use_sim_time", "qos_overrides./a.publisher.depth"], ["updates"])
    check_given(["robot_description", "diagnostic_updater.period", "update_rate"], ["updates"])
    with pytest.raises(UsageError, match="No node of drs has the parameter 'sede'; did you mean 'seed'"):
        check_given(["sede"], ["updates"])
    with pytest.raises(UsageError, match="did you mean 'speed'"):
        # its own come first
        check_given(["sped"], ["speed"])
