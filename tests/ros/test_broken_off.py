"""Episodes that an arm breaks off are repeated over real nodes, or left out with their other side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drs_interfaces.srv import Evaluate

from drs.episode_service import EpisodeService
from drs_core import json_lines
from drs_core.agent import Agent
from drs_core.episode import Episode, unfinished
from drs_core.errors import DrsError
from drs_core.rollouts import Task
from drs_core.search import Perturbation
from tests.conftest import make_agent
from tests.rollouts.test_not_finite import poison
from tests.ros.arm_of_episodes import CONFIG, Arm, agent_in, ended, offer, tuner
from tests.ros.graph import Graph
from tests.ros.test_rollouts import same
from tests.test_broken_off import plus, run
from tests.test_tuning import tune


def test_where_repeats_finish_the_result_is_that_of_a_run_that_was_never_disturbed(
    graph: Graph, tmp_path: Path
) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    # a side, the other one a time later, and every evaluation
    arm = offer(graph, Arm(lambda task, run: run == 1 and (task.perturbation is None or plus(task, 0, 3))))
    node = tuner(graph, begin, tmp_path / "run")
    ended(graph, node)
    assert node.process.returncode == 0, node.log.read_text()
    assert same(tmp_path / "run", expected)
    for name in ("evaluations.jsonl", "best.safetensors"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "expected" / name).read_bytes()
    history = json_lines.read(tmp_path / "run" / "history.jsonl")
    assert [(r["pairs_repeated"], r["pairs_dropped"]) for r in history] == [(2, 0)] * 3
    assert node.said("(the arm's reflex stopped it): they are run again")
    # both sides of a repeated pair were run twice, those of the others once
    runs = {(t.perturbation.direction, t.perturbation.sign): n for t, n in arm.runs.items() if t.perturbation}
    assert runs == {(i, sign): 2 if i in (0, 3) else 1 for i in range(4) for sign in (1, -1)}


def test_pairs_that_never_finish_are_left_out_whole(graph: Graph, tmp_path: Path) -> None:
    agent, begin = agent_in(tmp_path)
    expected = run(agent, tmp_path / "expected", lambda call, task: plus(task, 2), CONFIG)
    arm = offer(graph, Arm(lambda task, run: plus(task, 2)))
    node = tuner(graph, begin, tmp_path / "run")
    ended(graph, node)
    assert node.process.returncode == 0, node.log.read_text()
    assert same(tmp_path / "run", expected)
    history = json_lines.read(tmp_path / "run" / "history.jsonl")
    assert [(r["pairs_repeated"], r["pairs_dropped"]) for r in history] == [(1, 1)] * 3
    assert node.said("left out with its other side")
    assert {n for t, n in arm.runs.items() if t.perturbation and t.perturbation.direction == 2} == {3}


def test_where_too_few_finish_it_ends_with_a_sentence_and_goes_on_later(graph: Graph, tmp_path: Path) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    arm = offer(graph, Arm(lambda task, run: plus(task, 0, 1, 2) and task.perturbation.update == 1))
    node = tuner(graph, begin, tmp_path / "run", attempts=2)
    ended(graph, node)
    assert node.process.returncode == 1
    assert node.said("Only 1 of 4 pairs of rollouts could be finished in 2 attempts (the arm's reflex stopped it)")
    assert len(json_lines.read(tmp_path / "run" / "history.jsonl")) == 1
    arm.breaks = lambda task, run: False
    node = tuner(graph, begin, tmp_path / "run", "again", attempts=2)
    ended(graph, node)
    assert node.process.returncode == 0, node.log.read_text()
    assert same(tmp_path / "run", expected)


def test_an_arm_that_needs_somebody_is_waited_for(graph: Graph, tmp_path: Path) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    arm = offer(graph, Arm())
    sentence = "The arm is in reflex; look at it and call reset_reflex."

    def breaks(task: Task, run: int) -> bool:
        broken = run == 1 and plus(task, 1) and task.perturbation.update == 0
        arm.stuck = sentence if broken else arm.stuck
        return broken

    arm.breaks = breaks
    node = tuner(graph, begin, tmp_path / "run")
    graph.wait(lambda: node.said(f"cannot take part: {sentence}"), "the tuner to say why it waits")
    count = sum(arm.runs.values())
    arm.stuck = ""
    ended(graph, node)
    assert node.process.returncode == 0 and sum(arm.runs.values()) > count
    assert same(tmp_path / "run", expected)
    assert [r.get("pairs_dropped") for r in json_lines.read(tmp_path / "run" / "history.jsonl")] == [0, None, None]


def test_a_node_puts_its_own_runner_in_the_simulators_place() -> None:
    class ArmRunner:
        def load(self, theta: np.ndarray) -> None:
            self.theta = theta

        def run(self, seed: int, measure: frozenset[str]) -> Episode:
            return unfinished(seed, "somebody is in the way")

        def close(self) -> None: ...

    class Service(EpisodeService):
        def make(self, agent: Agent, backend: str) -> ArmRunner:
            self.runner = ArmRunner()
            return self.runner

    service, agent = Service(), make_agent()
    service.load(agent)
    candidate = Perturbation(0, 0, 0, 1, 0.1)
    ((episode,), _) = service.run([Task(3, perturbation=candidate)])
    assert (episode.seed, episode.finished, episode.why) == (3, False, "somebody is in the way")
    np.testing.assert_array_equal(service.runner.theta, candidate.candidate(agent.theta))


def test_a_simulator_in_which_an_episode_failed_is_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    service, tasks = EpisodeService(), [Task(1), Task(2)]
    service.load(make_agent("PandaReach-v3"))
    expected, _ = service.run(tasks)
    with poison(monkeypatch):
        service.run(tasks)
    assert service.run(tasks)[0] == expected


def test_an_arms_runner_that_says_that_somebody_has_to_look_stays() -> None:
    made: list[Stuck] = []

    class Stuck:
        """It knows of its reflex."""

        def __init__(self) -> None:
            made.append(self)

        def load(self, theta: object) -> None:
            """Nothing to do."""

        def run(self, seed: int, measure: object) -> Episode:
            """Refuse."""
            raise DrsError("Somebody has to look.")

        def close(self) -> None:
            """Nothing to do."""

    service = EpisodeService()
    service.make = lambda agent, backend: Stuck()  # type: ignore[method-assign,assignment,return-value]
    service.load(make_agent("PandaReach-v3"))
    for _ in range(2):
        with pytest.raises(DrsError, match="Somebody has to look"):
            service.run([Task(1)])
    assert len(made) == 1


@pytest.mark.parametrize(("broken", "words"), [({1}, "1 could not be finished"), (set(range(9)), "Only 0 of 4")])
def test_an_evaluation_counts_whole_episodes_alone(graph: Graph, tmp_path: Path, broken: set[int], words: str) -> None:
    _, begin = agent_in(tmp_path)
    offer(graph, Arm(lambda task, run: task.seed in broken))
    node = tuner(graph, begin, tmp_path / "run", autostart=False)
    graph.wait(lambda: node.said("ready"), "the tuner")
    answer = graph.call(Evaluate, "/evaluate", Evaluate.Request(episodes=4))
    assert words in answer.message
    assert answer.success == (len(broken) == 1)
    if answer.success:
        assert (answer.episodes, answer.unfinished, len(answer.returns)) == (3, 1, 3)
