"""Tuning over simulator nodes comes out as in one process, whatever happens to the simulators."""

from __future__ import annotations

import json
import signal
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drs_interfaces.action import Tune
from drs_interfaces.msg import TuningProgress

from drs.qos import LATCHED
from drs_core.agent import Agent, load
from drs_core.importing import resolve
from drs_core.rollouts import InProcess
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning
from tests.ros.graph import Graph, NodeProcess

SETTINGS = {"objective": "smooth", "updates": 4, "directions": 12, "seed": 5, "evaluate_every": 0}


class Silent:
    def on_rollouts(self, update: int, done: int, total: int) -> None: ...

    def on_update(self, record: dict[str, Any]) -> None: ...

    def on_evaluation(self, record: dict[str, Any]) -> None: ...


def in_process(path: Path, updates: int, done: int) -> Agent:
    """The agent that the settings give in this process after `done` of `updates` updates."""
    agent = resolve("panda_reach")
    config = tune_config(SETTINGS | {"updates": updates, "evaluation_episodes": 100})
    tuning = Tuning(agent, "panda_reach", config, path)
    with closing(InProcess(agent)) as rollouts:
        return tuning.run(rollouts, Silent(), done)


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Agent:
    """The agent that the settings give in this process."""
    return in_process(tmp_path_factory.mktemp("run") / "run", SETTINGS["updates"], SETTINGS["updates"])


def simulators(graph: Graph, count: int) -> list[NodeProcess]:
    nodes = [graph.start("simulator_node", f"simulator_{i}", stream=False) for i in range(count)]
    for node in nodes:
        graph.wait(lambda node=node: node.said("ready"), node.name)
    return nodes


def tuner(graph: Graph, output: Path, **more: Any) -> NodeProcess:
    settings = SETTINGS | {"autostart": True, "exit_when_done": True, "output": output} | more
    return graph.start("tuner_node", **settings)


def done(node: NodeProcess) -> bool:
    return node.process.poll() is not None


def same(path: Path, agent: Agent) -> bool:
    return np.array_equal(load(path / "agent.safetensors").theta, agent.theta)


def test_an_update_is_the_same_bit_for_bit(graph: Graph, tmp_path: Path, expected: Agent) -> None:
    simulators(graph, 2)
    node = tuner(graph, tmp_path / "run")
    graph.wait(lambda: done(node), "the end of tuning")
    assert node.process.returncode == 0
    assert same(tmp_path / "run", expected)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_it_is_the_same_where_a_simulator_dies_or_hangs(
    graph: Graph, tmp_path: Path, expected: Agent, number: int
) -> None:
    victim, _ = simulators(graph, 2)
    node = tuner(graph, tmp_path / "run", call_deadline_s=3.0)
    graph.wait(lambda: node.said("update 1/"), "the first update")
    victim.send(number)
    graph.wait(lambda: done(node), "the end of tuning")
    assert node.process.returncode == 0
    assert same(tmp_path / "run", expected)


def test_it_waits_for_simulators_and_takes_those_that_come_later(graph: Graph, tmp_path: Path) -> None:
    node = tuner(graph, tmp_path / "run", updates=200)
    graph.wait(lambda: node.said("Waiting for a simulator; start one: ros2 run drs simulator_node"), "the waiting line")
    simulators(graph, 1)
    graph.wait(lambda: node.said("update 1/"), "the first update")
    graph.start("simulator_node", "late", stream=False)
    graph.wait(lambda: node.said("on 2 simulators"), "an update on both")
    node.interrupt()
    found = load(tmp_path / "run" / "agent.safetensors")
    assert same(tmp_path / "run", in_process(tmp_path / "again", 200, found.tuning[-1]["updates_done"]))


@pytest.mark.parametrize("deadline_s", [3.0, 300.0])
def test_a_restarted_simulator_of_the_same_name_is_used_again(
    graph: Graph, tmp_path: Path, expected: Agent, deadline_s: float
) -> None:
    (victim,) = simulators(graph, 1)
    node = tuner(graph, tmp_path / "run", call_deadline_s=deadline_s)
    graph.wait(lambda: node.said("update 1/"), "the first update")
    victim.kill()
    graph.start("simulator_node", victim.name, stream=False)
    graph.wait(lambda: done(node), "the end of tuning")
    assert same(tmp_path / "run", expected)


def test_the_action_gives_feedback_and_a_cancelled_run_is_continued(
    graph: Graph, tmp_path: Path, expected: Agent
) -> None:
    simulators(graph, 2)
    graph.start_ready("tuner_node", **SETTINGS, agents_root=tmp_path, agent="panda_reach")
    client = graph.action(Tune, "tune", "tuner_node")
    shown: list[TuningProgress] = []
    graph.client.create_subscription(TuningProgress, "tuning/progress", shown.append, LATCHED)
    graph.wait(lambda: bool(shown), "the latched progress")

    feedback: list[Any] = []
    sending = client.send_goal_async(Tune.Goal(output="run"), feedback_callback=feedback.append)
    goal = graph.finish(sending, "the goal")
    assert goal.accepted
    graph.wait(lambda: bool(feedback), "feedback")
    assert feedback[0].feedback.progress.update == 1
    graph.finish(goal.cancel_goal_async(), "the cancelling")
    result = graph.finish(goal.get_result_async(), "the result").result
    assert not result.success and "can be continued" in result.message
    assert 1 <= result.updates_done < SETTINGS["updates"]

    goal = graph.finish(client.send_goal_async(Tune.Goal(output="run")), "the second goal")
    result = graph.finish(goal.get_result_async(), "the second result").result
    assert result.success, result.message
    assert result.updates_done == SETTINGS["updates"]
    assert same(tmp_path / "run", expected)

    goal = graph.finish(client.send_goal_async(Tune.Goal(output="../run")), "a goal that leads out")
    result = graph.finish(goal.get_result_async(), "its result").result
    assert not result.success and "plain name" in result.message


def test_a_run_that_goes_on_with_other_versions_is_a_warning_in_the_log(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "run"
    in_process(path, 2, 1)
    content = json.loads((path / "run.json").read_text())
    here = content["versions"]
    (path / "run.json").write_text(json.dumps(content | {"versions": {**here, "numpy": "1.26.0"}}))
    simulators(graph, 1)
    node = tuner(graph, path, updates=2, evaluation_episodes=100)
    graph.wait(lambda: done(node), "the end of tuning")
    assert node.process.returncode == 0, node.log.read_text()
    (line,) = (line for line in node.log.read_text().splitlines() if "goes on with" in line)
    assert "[WARN]" in line and f"numpy {here['numpy']} (before: 1.26.0): its results may differ" in line
    assert json.loads((path / "run.json").read_text())["resumed_with"] == [{"update": 1, "versions": here}]
