"""Backing off: a search that is lost goes on from its best agent, with more careful steps."""

import shutil
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core import json_lines
from drs_core.agent import load
from drs_core.backing_off import KEY, LOST, MOST, WINDOW, is_lost, more_careful, said, start_again
from drs_core.errors import UsageError
from drs_core.rollouts import InProcess, Task
from drs_core.search import SearchConfig, baseline_seeds
from drs_core.tuning import Tuning
from tests.conftest import make_agent
from tests.test_tuning import CONFIG, Interrupting, same, tune

# lost after the first WINDOW updates, and after the next: steps and perturbations are far too large
LOSING = replace(
    CONFIG,
    search=replace(CONFIG.search, updates=2 * WINDOW + 4, directions=2, alpha=(9.0, 1.0), sigma=(3.0, 1.0)),
    evaluate_every=4,
    back_off=True,
)
FINITE = st.floats(-1e6, 1e6)
SPREAD = st.floats(0.0, 1e6)


def figures(mean: float, std: float) -> dict[str, float]:
    return {"objective_mean": mean, "objective_std": std}


@given(FINITE, st.floats(1e-3, 1e6), SPREAD, st.integers(0, 3 * WINDOW))
def test_it_is_lost_where_its_episodes_are_clearly_worse_and_not_elsewhere(mean, std, own, count):
    start, unit = figures(mean, std), max(std, own)
    assert not is_lost([figures(mean - (LOST - 0.01) * unit, own)] * count, start)
    assert not is_lost([figures(mean + 1.0, own)] * count, start)
    assert is_lost([figures(mean - (LOST + 0.01) * unit, own)] * count, start) == (count >= WINDOW)


def test_only_what_came_after_the_newest_going_back_counts():
    start, low, back = figures(0.0, 1.0), figures(-1.0, 1.0), figures(-1.0, 1.0) | {KEY: 1}
    lost = [low] * WINDOW
    assert is_lost(lost, start)
    assert not is_lost([*lost, back, *lost[:-2]], start)
    assert is_lost([*lost, back, *lost[:-1]], start)
    # and twice is enough
    assert not is_lost([*lost, back, *lost, back | {KEY: MOST}, *lost], start)


@given(FINITE, st.floats(1e-3, 1e6), SPREAD, st.integers(0, 2 * WINDOW), st.integers(0, 2 * WINDOW))
def test_what_it_had_gained_may_not_be_lost_either(mean, gained, own, before, after):
    unit = max(gained, own)
    start, back = figures(mean - 9.0 * unit, gained), {KEY: 1}
    best, lower = [figures(mean, gained)] * before, figures(mean - (LOST + 0.01) * unit, own)
    assert not is_lost([*best, *[figures(mean - (LOST - 0.01) * unit, own)] * after], start)
    assert is_lost([*best, *[lower] * after], start) == (before >= WINDOW and after >= WINDOW)
    # what was gained before going back is no measure of the more careful search
    assert not is_lost([*best, lower | back, *[lower] * after], start)


def test_without_any_spread_it_is_not_said():
    assert not is_lost([figures(-1.0, 0.0)] * WINDOW, figures(0.0, 0.0))


def test_numbers_too_large_for_a_mean_are_not_judged():
    assert not is_lost([figures(-1e308, 1e308)] * WINDOW, figures(1e308, 1e308))


def test_first_the_steps_get_shorter_then_the_perturbations():
    search = SearchConfig(alpha=(0.4, 0.2), sigma=(0.8, 0.4), top=3)
    assert more_careful(search, 0) is search
    once = replace(search, alpha=(0.2, 0.1), top=0)
    assert more_careful(search, 1) == once
    assert more_careful(search, 2) == replace(once, alpha=(0.1, 0.05), sigma=(0.2, 0.1))


def test_a_run_that_is_lost_goes_on_from_its_best_agent(agent, tmp_path):
    tune(agent, tmp_path, config=LOSING, stop_after=WINDOW)
    best = load(tmp_path / "best.safetensors").theta
    assert not np.array_equal(best, load(tmp_path / "agent.safetensors").theta)
    tuned = tune(agent, tmp_path, config=LOSING, stop_after=WINDOW + 1, resume=True)
    found, search = json_lines.read(tmp_path / "history.jsonl")[-1], more_careful(LOSING.search, 1)
    assert found[KEY] == 1 and found["alpha"] == search.alpha_at(WINDOW) and found["sigma"] == search.sigma_at(WINDOW)
    assert found["step_norm"] == pytest.approx(np.linalg.norm(tuned.theta.astype(float) - best))
    assert "back to the best agent" in said(found) and f"before update {WINDOW + 1}:" in said(found)
    tune(agent, tmp_path, config=LOSING, resume=True)
    history = json_lines.read(tmp_path / "history.jsonl")
    assert [record[KEY] for record in history if KEY in record] == [1, 2]
    assert history[-1]["sigma"] == more_careful(LOSING.search, 2).sigma_at(len(history) - 1)
    assert [said(record) for record in history if KEY not in record] == [""] * (len(history) - 2)


def test_luck_of_the_first_evaluation_is_found_out(agent, tmp_path):
    lucky = replace(LOSING, search=replace(LOSING.search, alpha=(0.0, 0.0), sigma=(1e-9, 1e-9)))
    tune(agent, tmp_path, config=lucky, stop_after=WINDOW)
    path = tmp_path / "evaluations.jsonl"
    first, *others = json_lines.read(path)
    lucky_mean = first["objective_mean"] + 1e6
    path.unlink()
    for record in (first | {"objective_mean": lucky_mean, "objective_std": 0.0}, *others):
        json_lines.append(path, record)
    best = load(tmp_path / "best.safetensors")
    best.with_theta(best.theta, ({**best.tuning[-1], "objective_mean": lucky_mean},)).save(
        tmp_path / "best.safetensors"
    )
    tune(agent, tmp_path, config=lucky, resume=True)
    history = json_lines.read(tmp_path / "history.jsonl")
    assert start_again(history[:WINDOW]) is None
    with closing(InProcess(agent)) as rollouts:
        episodes = rollouts.run(agent.theta, [Task(seed) for seed in baseline_seeds(lucky.search.seed, 32)])
    returns = np.array([episode.return_ for episode in episodes])
    assert start_again(history[: WINDOW + 1]) == figures(returns.mean(), returns.std())
    # 32 say that it is where it began
    assert not any(KEY in record for record in history)


def test_resumed_after_any_update_or_within_it_is_the_same(agent, tmp_path):
    straight, path = tmp_path / "straight", tmp_path / "run"
    tune(agent, straight, config=LOSING)
    for done in range(3, LOSING.search.updates + 1):
        tune(agent, path, config=LOSING, stop_after=done, resume=True)
        if done < LOSING.search.updates:
            with pytest.raises(KeyboardInterrupt):
                tune(agent, path, config=LOSING, observer=Interrupting(done + 1), resume=True)
    same(path, straight)


def rewritten(path, change):
    """The records of a file with one of them changed: by place, a function of the record; None takes it away."""
    records = json_lines.read(path)
    path.unlink()
    for place, record in enumerate(records):
        new = change.get(place, lambda same: same)(record)
        if new is not None:
            json_lines.append(path, new)


DAMAGE = {
    "gone": ("history", lambda path: path.unlink(), "each of its 22 updates once"),
    "cut": ("history", lambda path: path.write_bytes(path.read_bytes()[:-40]), "each of its 22 updates once"),
    "twice": (
        "history",
        lambda path: path.write_bytes(2 * path.read_bytes()),
        "each of its 22 updates once",
    ),
    "never so often": (
        "history",
        lambda path: rewritten(path, {20: lambda r: r | {KEY: 99999}}),
        r"\[99999\], not 1 to 2",
    ),
    "a text": ("history", lambda path: rewritten(path, {20: lambda r: r | {KEY: "x"}}), r"\['x'\], not 1 to 2"),
    "below": ("history", lambda path: rewritten(path, {20: lambda r: r | {KEY: -5000}}), r"\[-5000\], not 1 to 2"),
    "no number": (
        "history",
        lambda path: rewritten(path, {3: lambda r: r | {"objective_mean": "q"}}),
        "objective_mean of update 4",
    ),
    "no start": (
        "history",
        lambda path: rewritten(path, {20: lambda r: r | {"start_again_objective_mean": []}}),
        "start_again",
    ),
    "not evaluated": ("evaluations", lambda path: path.unlink(), "each evaluation of its 22 updates once"),
    "first gone": (
        "evaluations",
        lambda path: rewritten(path, {0: lambda r: None}),
        "each evaluation of its 22 updates",
    ),
    "nothing said": (
        "evaluations",
        lambda path: rewritten(path, {0: lambda r: {"update": 0}}),
        "objective_mean of update 0",
    ),
    "a list": (
        "evaluations",
        lambda path: rewritten(path, {0: lambda r: r | {"objective_std": []}}),
        "objective_std of update 0",
    ),
}


@pytest.mark.parametrize("how", DAMAGE)
def test_what_decides_it_has_to_be_whole(agent, tmp_path, lost, how):
    shutil.copytree(lost, tmp_path / "run")
    name, damage, said = DAMAGE[how]
    damage(tmp_path / "run" / f"{name}.jsonl")
    before = {file.name: file.read_bytes() for file in (tmp_path / "run").glob("*.safetensors")}
    with pytest.raises(UsageError, match=said):
        Tuning(agent, "agent", LOSING, tmp_path / "run", resume=True)
    assert before == {file.name: file.read_bytes() for file in (tmp_path / "run").glob("*.safetensors")}


@pytest.fixture(scope="module")
def lost(tmp_path_factory):
    """A run that has gone back once."""
    path = tmp_path_factory.mktemp("lost")
    tune(make_agent(), path, config=LOSING, stop_after=WINDOW + 2)
    return path


def test_without_it_a_run_is_the_one_of_before(agent, tmp_path):
    never = replace(LOSING, back_off=False)
    tune(agent, tmp_path, config=never)
    assert not any(KEY in record for record in json_lines.read(tmp_path / "history.jsonl"))
    with pytest.raises(UsageError, match="back_off = False, not True"):
        Tuning(agent, "agent", LOSING, tmp_path, resume=True)


def test_there_is_no_best_agent_without_evaluations():
    with pytest.raises(UsageError, match="evaluate_every is 0"):
        replace(LOSING, evaluate_every=0)
