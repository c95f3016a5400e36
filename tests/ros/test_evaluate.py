"""/evaluate answers with the numbers of the library, exactly."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
from drs_interfaces.srv import Evaluate

from drs_core.evaluation import evaluate, summary
from drs_core.importing import resolve
from drs_core.rollouts import local
from tests.ros.graph import Graph

EPISODES = 100


def test_a_hundred_episodes_on_two_simulators_equal_those_of_the_library(graph: Graph) -> None:
    for name in ("simulator_1", "simulator_2"):
        graph.start("simulator_node", name, stream=False)
    graph.start_ready("tuner_node", agent="panda_reach", evaluation_episodes=EPISODES)
    answer = graph.call(Evaluate, "/evaluate")
    assert answer.success, answer.message
    agent = resolve("panda_reach")
    with closing(local(agent, 2)) as rollouts:
        evaluation = evaluate("panda_reach", agent, rollouts, EPISODES, 0)
    expected = summary(evaluation)
    assert np.array_equal(np.array(answer.returns), evaluation.returns)
    for name in (
        "agent", "environment", "episodes", "return_mean", "return_std", "length_mean", "failure_percent",
        "success_percent", "dimension_mean", "dimension_std", "dimension_lower_mean", "dimension_upper_mean",
    ):  # fmt: skip
        assert getattr(answer, name) == expected[name], name
    assert [answer.return_ci_low, answer.return_ci_high] == expected["return_ci95"]
    assert [answer.failure_ci_low, answer.failure_ci_high] == expected["failure_ci95"]


def test_it_takes_its_turn_beside_a_run_and_says_so(graph: Graph, tmp_path: Path) -> None:
    graph.start("simulator_node", stream=False)
    node = graph.start_ready(
        "tuner_node", autostart=True, updates=1000, directions=8, output=tmp_path / "run", evaluate_every=0
    )
    graph.wait(lambda: node.said("update 1/"), "the first update")
    answer = graph.call(Evaluate, "/evaluate", Evaluate.Request(episodes=5, seed=3))
    assert answer.success and answer.episodes == 5 and "beside a tuning run" in answer.message
    graph.wait(lambda: node.said("update 3/"), "the run to go on")


def test_wrong_requests_are_answered_with_a_sentence(graph: Graph) -> None:
    graph.start("simulator_node", stream=False)
    graph.start_ready("tuner_node")
    for request, words in (
        (Evaluate.Request(agent="nobody"), "There is no agent 'nobody'"),
        (Evaluate.Request(agent="../secret"), "not a plain name"),
        (Evaluate.Request(agent="/etc/passwd"), "not a plain name"),
        (Evaluate.Request(episodes=10**9), "episodes is 1000000000"),
        (Evaluate.Request(seed=2**64 - 1), "seed is"),
    ):
        answer = graph.call(Evaluate, "/evaluate", request)
        assert not answer.success and words in answer.message, answer.message
    assert graph.call(Evaluate, "/evaluate", Evaluate.Request(episodes=2)).success


def test_without_a_simulator_it_gives_up_with_a_sentence(graph: Graph) -> None:
    graph.start_ready("tuner_node", evaluation_patience_s=1.0)
    answer = graph.call(Evaluate, "/evaluate")
    assert not answer.success and "ros2 run drs simulator_node" in answer.message


def test_it_gives_up_also_while_a_run_waits_for_a_simulator(graph: Graph, tmp_path: Path) -> None:
    settings = {"updates": 1000, "directions": 8, "evaluate_every": 0, "output": tmp_path / "run"}
    node = graph.start_ready("tuner_node", autostart=True, evaluation_patience_s=2.0, **settings)
    graph.wait(lambda: node.said("Waiting for a simulator"), "the run to wait")
    answer = graph.call(Evaluate, "/evaluate")
    assert not answer.success and "No simulator for 2 s; start one: ros2 run drs simulator_node" in answer.message
    # the run has lost nothing by it
    graph.start("simulator_node", stream=False)
    graph.wait(lambda: node.said("update 1/"), "the first update")
    assert graph.call(Evaluate, "/evaluate", Evaluate.Request(episodes=2)).success


def test_simulators_that_all_refuse_are_none_however_often_they_are_asked(graph: Graph) -> None:
    graph.start_ready("simulator_node", environment="PandaReach-v3", stream=False)
    # longer than a refused simulator is left alone
    graph.start_ready("tuner_node", evaluation_patience_s=12.0)
    answer = graph.call(Evaluate, "/evaluate", Evaluate.Request(agent="panda_push", episodes=2))
    assert not answer.success and "runs PandaReach-v3 only" in answer.message
