"""A parameter that nobody has ends the node that is given it, or all of drs graph before a node is started."""

from __future__ import annotations

from pathlib import Path

import pytest

from drs_core.node_parameters import NODES as KNOWN
from tests.ros.graph import NODES, Graph
from tests.ros.test_docs import script
from tests.ros.test_graph_command import start

EXECUTABLES = ("mock_arm_node", "policy_node", "recorder_node", "simulator_node", "tuner_node")


def test_the_library_knows_every_parameter_of_every_node() -> None:
    assert set(KNOWN) == {path.name for path in NODES.glob("*_node")} == set(EXECUTABLES)
    for node, parameters in script("parameter_tables").nodes().items():
        assert KNOWN[node] == {parameter.name for parameter in parameters}, node


@pytest.mark.parametrize("executable", EXECUTABLES)
def test_a_node_refuses_what_no_node_has(graph: Graph, executable: str) -> None:
    node = graph.start(executable, agnet="panda_reach")
    assert node.process.wait(timeout=30) == 2
    assert node.said("drs: No node of drs has the parameter 'agnet'; did you mean 'agent'?")
    assert not node.said("Traceback") and not node.said("ready")


def test_a_node_passes_over_what_another_has(graph: Graph) -> None:
    # as a section for all nodes gives it
    given = {"environment": "PandaReach-v3", "velocity_scale": 0.3, "use_sim_time": False}
    graph.start_ready("tuner_node", **given, **{"qos_overrides./clock.subscription.depth": 3})


def test_drs_graph_starts_nothing_with_a_slip_in_its_file(graph: Graph, tmp_path: Path) -> None:
    params, log = tmp_path / "params.yaml", tmp_path / "graph.log"
    params.write_text("/**: {ros__parameters: {agent: panda_reach}}\ntuner_node: {ros__parameters: {updaets: 2}}\n")
    process = start(graph, params, log=log)
    try:
        assert process.wait(timeout=30) == 2
    finally:
        # so that it ends its nodes, if it has started them after all
        process.terminate()
        process.wait()
    (line,) = log.read_text().splitlines()
    assert "sets 'updaets', which tuner_node does not have; did you mean 'updates'?" in line
