"""What is compared with the search: each method is what its name says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.bench.sample_cost.methods import FRUGAL, METHODS, PAPER, Entry
from drs_core.bench.sample_cost.methods.direct import Direct, Guided, Orthogonal, Ranks, TopDirections
from drs_core.parameters import read_parameters
from drs_core.search import SearchConfig, ask, episode_seed, tell
from drs_core.tuning import tune_config
from tests.conftest import make_agent

ROOT = Path(__file__).parents[2]
CONFIG = SearchConfig(updates=10, directions=4, seed=3)
THETA = np.linspace(-1.0, 1.0, 30, dtype=np.float32)
AGENT = make_agent("Pendulum-v1", (4,))
OURS = [name for name, entry in METHODS.items() if entry.kind not in ("sep_cma", "pgpe", "snes")]


def hill(candidates) -> np.ndarray:
    """Higher towards a point, with the episode's own luck."""
    return np.array([-np.sum((theta - 0.3) ** 2) + 1e-3 * (seed % 7) for theta, seed in candidates])


def test_the_direct_search_is_the_product_s():
    method, theta = Direct(CONFIG, THETA), THETA
    for update in range(3):
        asked = list(method.ask())
        wanted = [(perturbation.candidate(theta), seed) for perturbation, seed in ask(CONFIG, update)]
        for (mine, seed), (theirs, other) in zip(asked, wanted, strict=True):
            # sums are rounded in another order
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-6)
            assert seed == other
        objectives = hill(asked)
        method.tell(objectives)
        theta = tell(CONFIG, update, theta, objectives.reshape(-1, 2))
        np.testing.assert_allclose(method.theta, theta, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_climbs_and_what_it_was_told_brings_it_back(name: str):
    if name not in OURS:
        pytest.importorskip("cma" if name == "sep_cma" else "evotorch")
    known = METHODS[name]
    entry = replace(known, config=replace(known.config, alpha=(0.05, 0.05), sigma=(0.05, 0.05)))
    method, told = entry.make(5, AGENT), []

    def value(candidates):
        asked = list(candidates)
        assert len(asked) == method.rollouts
        told.append(hill(asked))
        return told[-1]

    for _ in range(30):
        method.update(value)
    assert hill([(method.theta, 0)]) > hill([(AGENT.theta, 0)]) + 0.2
    again = entry.make(5, AGENT)
    for objectives in told:
        again.update(lambda _, objectives=objectives: objectives)
    assert np.array_equal(again.theta, method.theta) and again.theta.dtype == np.float32


@pytest.mark.parametrize("name", OURS)
def test_both_sides_of_a_direction_meet_the_same_episode(name: str):
    method, asked = METHODS[name].make(2, AGENT), []

    def value(candidates):
        asked[:] = candidates
        return hill(asked)

    for update in range(3):
        theta = method.theta.copy()
        method.update(value)
        assert [seed for _, seed in asked] == [episode_seed(2, update, index // 2) for index in range(method.rollouts)]
        for (plus, _), (minus, _) in zip(asked[::2], asked[1::2]):
            np.testing.assert_allclose(plus + minus, 2 * theta, rtol=0, atol=1e-5)
            assert not np.array_equal(plus, minus)


def test_a_search_of_the_last_layer_moves_nothing_else():
    entry = Entry("", "direct", SearchConfig(10, 4, last_layer=True))
    method, start = entry.make(0, AGENT), AGENT.network.last_layer_start
    method.update(hill)
    assert 0 < start < len(AGENT.theta) and np.array_equal(method.theta[:start], AGENT.theta[:start])
    assert (method.theta[start:] != AGENT.theta[start:]).all()
    objectives = hill((p.candidate(AGENT.theta), seed) for p, seed in ask(entry.config, 0, start))
    theta = tell(entry.config, 0, AGENT.theta, objectives.reshape(-1, 2), start)
    np.testing.assert_allclose(method.theta, theta, rtol=0, atol=1e-6)


def test_orthogonal_directions_keep_their_lengths():
    plain, method = list(Direct(CONFIG, THETA).deltas()), list(Orthogonal(CONFIG, THETA).deltas())
    products = np.array(method) @ np.array(method).T
    np.testing.assert_allclose(products, np.diag([np.sum(delta**2) for delta in plain]), atol=1e-4)
    # more directions than dimensions: orthogonal within each block
    many = list(Orthogonal(replace(CONFIG, directions=7), THETA[:3]).deltas())
    assert len(many) == 7 and abs(many[3] @ many[4]) < 1e-5


def test_guided_directions_are_as_long_and_lean_towards_past_steps():
    config = replace(CONFIG, directions=200)
    method = Guided(config, THETA)
    method.update(hill)
    (step,) = method._steps
    along = step / np.linalg.norm(step)
    deltas = np.array(list(method.deltas()))
    assert np.mean(np.sum(deltas**2, axis=1)) == pytest.approx(30, rel=0.15)
    # half of the variance, and a thirtieth of the other half
    assert np.mean((deltas @ along) ** 2) == pytest.approx(15.5, rel=0.25)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), min_size=4, max_size=4))
def test_weights(pairs):
    objectives = np.array(pairs)
    plain, top, ranks = (kind(CONFIG, THETA).weights(objectives) for kind in (Direct, TopDirections, Ranks))
    for weights in (plain, top, ranks):
        assert weights.shape == (4,) and np.isfinite(weights).all()
    assert np.count_nonzero(top) <= 2
    # ranks know the order and nothing else
    assert np.array_equal(ranks, Ranks(CONFIG, THETA).weights(2 * objectives))
    assert all(np.sign(weight) in (0, np.sign(a - b)) for weight, (a, b) in zip(ranks, objectives))


@pytest.mark.parametrize(("name", "config"), [("paper", PAPER), ("frugal", FRUGAL)])
def test_a_preset_is_the_method_of_its_name(name: str, config: SearchConfig):
    assert tune_config(read_parameters(ROOT / f"params/{name}.yaml")).search == config
