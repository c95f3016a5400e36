"""What is compared with the search: each method is what its name says."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drs_core import json_lines
from drs_core.backing_off import MOST, start_again, times
from drs_core.bench.sample_cost.methods import FRUGAL, METHODS, PAPER, Entry
from drs_core.bench.sample_cost.methods.direct import EPISODES, EVERY
from drs_core.objective import BASELINE_EPISODES
from drs_core.parameters import read_parameters
from drs_core.rollouts import InProcess, Task
from drs_core.scope import Scope
from drs_core.search import SearchConfig, ask, episode_seed, tell
from drs_core.tune_config import tune_config
from tests.conftest import make_agent
from tests.test_tuning import tune

ROOT = Path(__file__).parents[2]
AGENT = make_agent("Pendulum-v1", (4,))
OURS = [name for name, entry in METHODS.items() if entry.is_ours]


def hill(candidates) -> np.ndarray:
    """Higher towards a point, with the episode's own luck."""
    return np.array([-np.sum((theta - 0.3) ** 2) + 1e-3 * (seed % 7) for theta, seed in candidates])


def test_the_direct_search_is_the_product_s():
    method, theta, asked = METHODS["top4"].make(3, AGENT), AGENT.theta, []

    def value(candidates):
        asked[:] = candidates
        return hill(asked)

    config = replace(FRUGAL, seed=3)
    for update in range(3):
        method.update(value)
        wanted = [(perturbation.candidate(theta), seed) for perturbation, seed in ask(config, update)]
        for (mine, seed), (theirs, other) in zip(asked, wanted, strict=True):
            assert np.array_equal(mine, theirs) and seed == other
        theta = tell(config, update, theta, hill(wanted).reshape(-1, 2))
        assert np.array_equal(method.theta, theta)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_climbs_and_what_it_was_told_brings_it_back(name: str):
    if name not in OURS:
        pytest.importorskip("cma" if name == "sep_cma" else "evotorch")
    known = METHODS[name]
    entry = replace(known, config=replace(known.config, alpha=(0.05, 0.05), sigma=(0.05, 0.05)))
    method, told = entry.make(5, AGENT), []

    def value(candidates):
        told.append(hill(candidates))
        return told[-1]

    for update in range(30):
        before = sum(map(len, told))
        method.update(value)
        assert update or sum(map(len, told)) == entry.first
        assert 0 < sum(map(len, told)) - before <= entry.first + BASELINE_EPISODES * entry.back_off
    assert hill([(method.theta, 0)]) > hill([(AGENT.theta, 0)]) + 0.2
    again = entry.make(5, AGENT)
    recalled = iter(told)
    for _ in range(30):
        again.update(lambda _: next(recalled))
    assert np.array_equal(again.theta, method.theta) and again.theta.dtype == np.float32


@pytest.mark.parametrize("name", OURS)
def test_both_sides_of_a_direction_meet_the_same_episode(name: str):
    method, asked = METHODS[name].make(2, AGENT), []

    def value(candidates):
        # an evaluation comes before them
        asked[:] = candidates
        return hill(asked)

    for update in range(3):
        theta = method.theta.copy()
        method.update(value)
        assert [seed for _, seed in asked] == [episode_seed(2, update, index // 2) for index in range(len(asked))]
        for (plus, _), (minus, _) in zip(asked[::2], asked[1::2]):
            np.testing.assert_allclose(plus + minus, 2 * theta, rtol=0, atol=1e-5)
            assert not np.array_equal(plus, minus)


def test_a_search_of_the_last_layer_moves_nothing_else():
    entry = Entry("", "direct", SearchConfig(10, 4, last_layer=True))
    method, start = entry.make(0, AGENT), AGENT.network.last_layer_start
    method.update(hill)
    assert 0 < start < len(AGENT.theta) and np.array_equal(method.theta[:start], AGENT.theta[:start])
    assert (method.theta[start:] != AGENT.theta[start:]).all()
    objectives = hill((p.candidate(AGENT.theta), seed) for p, seed in ask(entry.config, 0, Scope(start)))
    theta = tell(entry.config, 0, AGENT.theta, objectives.reshape(-1, 2), Scope(start))
    assert np.array_equal(method.theta, theta)


@pytest.mark.parametrize(
    ("name", "config"), [("paper", PAPER), ("frugal", FRUGAL), ("frugal_smooth", METHODS["smooth"].config)]
)
def test_a_preset_is_the_method_of_its_name(name: str, config: SearchConfig):
    assert tune_config(read_parameters(ROOT / f"params/{name}.yaml")).search == config


def test_frugal_backs_off_as_the_product_does(tmp_path: Path):
    preset = tune_config(read_parameters(ROOT / "params/frugal.yaml"))
    frugal, agent = METHODS["frugal"], make_agent()
    assert (preset.back_off, preset.evaluate_every, preset.evaluation_episodes) == (frugal.back_off, EVERY, EPISODES)
    # steps and perturbations with which it is lost, and lost again
    search = replace(preset.search, updates=45, alpha=(9.0, 1.0), sigma=(3.0, 1.0), directions=2)
    product = tune(agent, tmp_path / "run", config=replace(preset, search=search))
    method = replace(frugal, config=search).make(search.seed, agent)
    with closing(InProcess(agent)) as rollouts:
        for _ in range(45):
            method.update(lambda asked: np.array([rollouts.run(t, [Task(s)])[0].return_ for t, s in asked]))
    assert np.array_equal(method.theta, product.theta)
    history = json_lines.read(tmp_path / "run" / "history.jsonl")
    assert times(history) == MOST and start_again(history) is not None
