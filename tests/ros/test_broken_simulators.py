"""One broken simulator does not end the run of a healthy fleet; where there is no other one, it says why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from drs_interfaces.srv import RunEpisodes

from drs.failures import MOST_FAILURES, Failures
from drs_core.agent import Agent
from tests.ros.arm_of_episodes import agent_in, ended, tuner
from tests.ros.fake_simulator import Changes, fake, refusals
from tests.ros.graph import Graph
from tests.ros.test_rollouts import in_process, same, simulators
from tests.ros.test_rollouts import tuner as tuner_of_reach


def one_too_few(_: Any, response: RunEpisodes.Response) -> None:
    response.episodes = response.episodes[:-1]


def another_seed(_: Any, response: RunEpisodes.Response) -> None:
    response.episodes[0].seed += 1


def another_request(_: Any, response: RunEpisodes.Response) -> None:
    response.request_id += 7


def failing(_: Any, response: RunEpisodes.Response) -> None:
    response.success, response.message = False, "Out of memory."


def failing_without_a_reason(_: Any, response: RunEpisodes.Response) -> None:
    response.success = False


WRONGS: list[tuple[Changes, str]] = [
    (one_too_few, "It answered with 0 episodes where 1 were asked."),
    (another_seed, "It answered with the episode of seed "),
    (another_request, "It answered to request "),
    (failing, "Out of memory."),
    (failing_without_a_reason, "it gave no reason"),
]


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Agent:
    return in_process(tmp_path_factory.mktemp("run") / "run", 1, 1)


@pytest.mark.parametrize(("wrong", "words"), WRONGS, ids=[wrong.__name__ for wrong, _ in WRONGS])
def test_a_healthy_simulator_does_the_work_of_a_broken_one(
    graph: Graph, tmp_path: Path, expected: Agent, wrong: Changes, words: str
) -> None:
    simulators(graph, 1)
    asked = fake(graph, "broken", wrong)
    node = tuner_of_reach(graph, tmp_path / "run", updates=1)
    ended(graph, node)
    log = node.log.read_text()
    assert node.process.returncode == 0, log
    assert same(tmp_path / "run", expected)
    lines = refusals(log, "broken")
    assert lines and all(line.startswith("[WARN]") and words in line for line in lines), log
    # two calls at a time, and after the second failure none for ten seconds
    assert len(asked) <= 3 * len(lines)


def test_an_episode_that_fails_wherever_it_is_run_ends_the_run_with_the_reason(graph: Graph, tmp_path: Path) -> None:
    _, begin = agent_in(tmp_path)
    bad: set[int] = set()

    def fails_one(request: RunEpisodes.Request, response: RunEpisodes.Response) -> None:
        bad.update([] if bad else [request.candidates[0].episode_seed])
        if bad & {candidate.episode_seed for candidate in request.candidates}:
            failing(request, response)

    asked = [fake(graph, name, fails_one) for name in ("one", "other")]
    node = tuner(graph, begin, tmp_path / "run")
    ended(graph, node)
    assert node.process.returncode == 1
    assert node.said(f"The episode of seed {next(iter(bad))} failed {MOST_FAILURES} times: Out of memory.")
    assert all(asked)


def test_a_task_is_given_up_where_nobody_is_left_who_did_not_fail_it() -> None:
    failures, all_ = Failures(), {"liar", "good"}
    assert not failures
    for _ in range(MOST_FAILURES):
        assert not failures.given_up(7, {"liar"})
        failures.add(7, "liar")
    assert failures.given_up(7, {"liar"}) and failures.given_up(7, set()) and not failures.given_up(7, all_)
    assert failures.for_others(7, "liar", all_) and not failures.for_others(7, "liar", {"liar"})
    assert not failures.for_others(7, "good", all_) and not failures.for_others(8, "liar", all_)
    failures.add(7, "good")
    assert failures.given_up(7, all_) and not failures.for_others(7, "liar", all_)
