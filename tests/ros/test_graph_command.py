"""`drs graph` starts the nodes of a parameter file together, and ends them together."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
import rclpy

from drs_core.agent import load
from drs_core.errors import UsageError
from drs_core.graph import GraphConfig, node_commands, node_process
from tests.ros.graph import ROOT, Graph

PARAMS = ROOT / "params" / "panda_reach.yaml"
DRS = [sys.executable, "-m", "drs_core.cli", "graph"]


def start(graph: Graph, *arguments: str | Path, log: Path) -> subprocess.Popen:
    # without a sourced workspace, as in a new terminal
    environment = {k: v for k, v in graph.environment.items() if k not in ("AMENT_PREFIX_PATH", "PYTHONPATH")}
    with open(log, "wb") as file:
        return subprocess.Popen(
            [*DRS, *arguments], stdout=file, stderr=file, env=environment, start_new_session=True, cwd=log.parent
        )


def test_ctrl_c_ends_every_node(graph: Graph, tmp_path: Path) -> None:
    log = tmp_path / "graph.log"
    process = start(graph, PARAMS, log=log)
    try:
        graph.wait(lambda: log.read_text().count("ready") == 4, "four nodes")
        children = psutil.Process(process.pid).children(recursive=True)
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(timeout=10) == 130
        assert not any(child.is_running() for child in children)
        assert "Traceback" not in log.read_text() and log.read_text().count("(rc=0)") == 4
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait()


ODD = 'it\'s "a": [ü, 😀] \\n {x} #1 $HOME := *'


@pytest.mark.parametrize("output", ["run", "2024", ODD], ids=["text", "number", "odd"])
def test_with_tune_it_ends_when_the_agent_is_tuned(graph: Graph, tmp_path: Path, output: str) -> None:
    params, log = tmp_path / "params.yaml", tmp_path / "graph.log"
    settings = "{agent: panda_reach, updates: 2, directions: 4, evaluate_every: 0}"
    params.write_text(f"tuner_node: {{ros__parameters: {settings}}}\n")
    process = start(graph, params, "--tune", "--simulators", "1", "--output", output, log=log)
    graph.wait(lambda: process.poll() is not None, "the end of tuning")
    assert process.returncode == 0, log.read_text()
    assert load(tmp_path / output / "agent.safetensors").tuning[-1]["updates_done"] == 2


TEXTS = (
    "2024", "true", "1e3", "null", "~", "", "[1, 2]", "{a: 1}", "- a", "!!int 3", "a: b", " x ", "\\", '"', "'", ODD,
    "tab\tline\n\x7f\x01\x85\u2028\ufeff", "x" * 4000,
)  # fmt: skip


@pytest.mark.parametrize("text", TEXTS)
def test_any_path_reaches_a_node_as_it_is(graph: Graph, text: str) -> None:
    tuner = node_commands(GraphConfig(PARAMS, output=Path(text)))["tuner_node"]
    recorder = node_process("recorder_node", {"output": text})[0][2]
    for arguments, expected in ((tuner, str(Path(text))), (shlex.split(recorder.rsplit("&& exec ", 1)[-1]), text)):
        settings = arguments[arguments.index("--ros-args") :]
        node = rclpy.create_node("tuner_node", context=graph.context, cli_args=settings, use_global_arguments=False)
        assert node.declare_parameter("output", "").value == expected
        node.destroy_node()


def test_only_the_first_simulator_streams() -> None:
    commands = node_commands(GraphConfig(PARAMS, simulators=3))
    assert list(commands) == ["simulator_node", "simulator_2", "simulator_3", "tuner_node", "policy_node"]
    assert [any("stream:=false" in part for part in command) for command in commands.values()] == [
        False, True, True, False, False,
    ]  # fmt: skip


def test_wrong_settings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no parameter file"):
        GraphConfig(tmp_path / "none.yaml")
    with pytest.raises(UsageError, match="simulators is 0"):
        GraphConfig(PARAMS, simulators=0)
    with pytest.raises(UsageError, match="not text in UTF-8"):
        GraphConfig(PARAMS, output=Path(os.fsdecode(b"caf\xe9")))
