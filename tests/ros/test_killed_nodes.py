"""kill -9 of a tuner node where it touches its run folder, and of its simulator: the run goes on to the same bytes."""

from __future__ import annotations

import signal
from contextlib import closing
from pathlib import Path

import pytest

from drs_core import json_lines
from drs_core.importing import resolve
from drs_core.rollouts import InProcess
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning
from tests.ros.graph import Graph, NodeProcess
from tests.ros.test_rollouts import Silent

SETTINGS = {"updates": 2, "directions": 1, "evaluate_every": 1, "evaluation_episodes": 1, "seed": 3}
HOOK = """
import os, signal, sys
def hook(event, arguments, seen=[0]):
    writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    if (writes or event in ("os.rename", "os.mkdir", "os.remove")) and {folder!r} in str(arguments[0]):
        seen[0] += 1
        if seen[0] == {point}:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(hook)
"""
"""For an interpreter that loads it as sitecustomize: it dies before its so-manieth touch of a folder."""
FEW, ALL = (4, 13), range(1, 60)


def tuner(graph: Graph, output: Path, inject: Path | None = None) -> NodeProcess:
    before = dict(graph.environment)
    if inject is not None:
        graph.environment["PYTHONPATH"] = f"{inject}:{before.get('PYTHONPATH', '')}"
    try:
        return graph.start("tuner_node", autostart=True, exit_when_done=True, output=output, **SETTINGS)
    finally:
        graph.environment = before


@pytest.mark.parametrize("points", [FEW, pytest.param(ALL, marks=pytest.mark.soak)], ids=["few", "all"])
def test_wherever_it_is_killed(graph: Graph, tmp_path: Path, points: tuple[int, ...]) -> None:
    agent = resolve("panda_reach")
    with closing(InProcess(agent)) as rollouts:
        Tuning(agent, "panda_reach", tune_config(SETTINGS), tmp_path / "straight").run(rollouts, Silent())
    simulator = graph.start_ready("simulator_node", stream=False)
    killed = 0
    for point in points:
        folder, inject = tmp_path / f"run_{point}", tmp_path / f"inject_{point}"
        inject.mkdir()
        (inject / "sitecustomize.py").write_text(HOOK.format(folder=str(folder), point=point))
        node = tuner(graph, folder, inject)
        graph.wait(lambda node=node: node.process.poll() is not None, "its end")
        if node.process.returncode == 0:
            break
        assert node.process.returncode == -signal.SIGKILL, node.log.read_text()
        killed += 1
        if point % 3 == 1:
            simulator.kill()
            simulator = graph.start_ready("simulator_node", stream=False)
        node = tuner(graph, folder)
        graph.wait(lambda node=node: node.process.poll() is not None, "the resumed run")
        assert node.process.returncode == 0, node.log.read_text()
        for name in ("agent.safetensors", "best.safetensors", "evaluations.jsonl", "run.json"):
            assert (folder / name).read_bytes() == (tmp_path / "straight" / name).read_bytes(), (point, name)
        assert [record["update"] for record in json_lines.read(folder / "history.jsonl")] == [1, 2]
    print(f"killed at {killed} points")
    assert killed == len(points) or (points is ALL and killed > 15)
