"""A node that nobody renames is called as its executable: so parameter files, SROS2 profiles and the pages do it."""

from __future__ import annotations

from pathlib import Path

from tests.ros.graph import NODES, Graph


def test_every_node_is_called_as_its_executable(graph: Graph, tmp_path: Path) -> None:
    executables = {path.name for path in NODES.glob("*_node")}
    assert len(executables) == 5
    for executable in executables:
        node = graph.start(executable, **({"output": tmp_path / "x.mcap"} if executable == "recorder_node" else {}))
        assert "-r" not in node.process.args
    names: set[str] = set()

    def all_there() -> bool:
        names.update(set(graph.client.get_node_names()) - {graph.client.get_name()})
        return len(names) == len(executables)

    graph.wait(all_there, "five nodes")
    assert names == executables
