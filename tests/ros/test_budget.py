"""A tuner node whose run is given in robot time, and one that ends a run that has gone flat."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from drs_interfaces.action import Tune

from drs_core import json_lines
from drs_core.stopping import RULE
from tests.conftest import make_agent
from tests.ros.graph import Graph, NodeProcess

RUN = {"autostart": True, "exit_when_done": True, "directions": 2, "evaluate_every": 2, "evaluation_episodes": 2}


def ended(graph: Graph, output: Path, **more: Any) -> NodeProcess:
    graph.start("simulator_node", stream=False)
    node = graph.start("tuner_node", output=output, **(RUN | more))
    graph.wait(lambda: node.process.poll() is not None, "the end of tuning", patience_s=90.0)
    return node


def updates(path: Path) -> tuple[int, int]:
    """Of the whole run, and done."""
    whole = json.loads((path / "run.json").read_text())["config"]["updates"]
    return whole, len(json_lines.read(path / "history.jsonl"))


def test_a_budget_takes_the_place_of_updates(graph: Graph, tmp_path: Path) -> None:
    """48 s of 2 s and one between them are 16 episodes: 3 updates of 4 and 2 evaluations of 2."""
    node = ended(graph, tmp_path / "run", updates=200, budget="48s", reset_seconds=1.0)
    assert node.process.returncode == 0
    assert node.said("A budget of 48s pays for 3 updates of 2 x 2 episodes, 2 evaluations of 2: 16 episodes")
    assert updates(tmp_path / "run") == (3, 3)


def test_a_goal_that_names_updates_wins_over_the_budget(graph: Graph, tmp_path: Path) -> None:
    graph.start("simulator_node", stream=False)
    settings = RUN | {"autostart": False, "budget": "1h", "agents_root": tmp_path}
    graph.start_ready("tuner_node", **settings)
    client = graph.action(Tune, "tune", "tuner_node")
    goal = graph.finish(client.send_goal_async(Tune.Goal(output="run", updates=1)), "the goal")
    result = graph.finish(goal.get_result_async(), "the result").result
    assert result.success, result.message
    assert updates(tmp_path / "run") == (1, 1)


def test_a_budget_that_pays_for_nothing_ends_the_node_with_a_sentence(graph: Graph, tmp_path: Path) -> None:
    for budget, words in {"5s": "too small for one update", "soon": "is no duration"}.items():
        node = graph.start("tuner_node", f"tuner_{budget}", output=tmp_path / "run", **RUN, budget=budget)
        graph.wait(lambda node=node: node.process.poll() is not None, "the end of the node")
        assert node.process.returncode != 0
        assert node.said(words) and not node.said("Traceback")
    assert not (tmp_path / "run").exists()


def test_a_flat_run_ends_done_and_says_so(graph: Graph, tmp_path: Path) -> None:
    """With a step that moves no parameter every evaluation is the same."""
    agent = tmp_path / "pendulum.safetensors"
    make_agent("Pendulum-v1").save(agent)
    still = {"agent": agent, "alpha": "[1.0e-30, 1.0e-30]", "updates": 40, "directions": 1, "evaluate_every": 1}
    node = ended(graph, tmp_path / "run", stop_when_flat=True, **still)
    assert node.process.returncode == 0
    assert updates(tmp_path / "run") == (40, RULE.least - 1)
    assert node.said(f"Flat after update {RULE.least - 1}: ") and node.said("run/best.safetensors.")
