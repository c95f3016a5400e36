"""One broken simulator does not end the run of a healthy fleet; where there is no other one, it says why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from drs_interfaces.srv import RunEpisodes

from drs.failures import MOST_FAILURES, Failures
from drs_core.agent import load
from tests.ros.arm_of_episodes import CONFIG, agent_in, ended, tuner
from tests.ros.fake_simulator import Changes, fake, refusals
from tests.ros.graph import Graph, NodeProcess
from tests.ros.test_rollouts import done, same, simulators
from tests.test_tuning import tune


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


@pytest.mark.parametrize(("wrong", "words"), WRONGS, ids=[wrong.__name__ for wrong, _ in WRONGS])
def test_a_healthy_simulator_does_the_work_of_a_broken_one(
    graph: Graph, tmp_path: Path, wrong: Changes, words: str
) -> None:
    agent, begin = agent_in(tmp_path)
    config = replace(CONFIG, search=replace(CONFIG.search, updates=1000))
    simulators(graph, 1)
    asked = fake(graph, "broken", wrong)
    node = tuner(graph, begin, tmp_path / "run", updates=config.search.updates)
    graph.wait(lambda: done(node) or bool(refusals(node.log.read_text(), "broken")), "the broken one to be left alone")
    before = updates(node)
    graph.wait(lambda: done(node) or updates(node) > before + 1, "the run to go on")
    status, _ = node.interrupt()
    log = node.log.read_text()
    assert status == 0, log
    found = load(tmp_path / "run" / "agent.safetensors")
    assert same(tmp_path / "run", tune(agent, tmp_path / "alone", found.tuning[-1]["updates_done"], config=config))
    lines = refusals(log, "broken")
    assert all(line.startswith("[WARN]") and words in line for line in lines), log
    # two calls at a time, and after the second failure none for ten seconds
    assert len(asked) <= 3 * len(lines)


def updates(node: NodeProcess) -> int:
    return node.log.read_text().count(": objective")


def test_an_episode_that_fails_wherever_it_is_run_ends_the_run_with_the_reason(graph: Graph, tmp_path: Path) -> None:
    _, begin = agent_in(tmp_path)
    bad: set[int] = set()

    def fails_one(request: RunEpisodes.Request, response: RunEpisodes.Response) -> None:
        # not before both take part: one alone may give it up
        if all(asked) and not bad:
            bad.add(request.candidates[0].episode_seed)
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
