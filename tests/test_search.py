import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.scope import ALL, Scope
from drs_core.search import Perturbation, SearchConfig, ask, direction, episode_seed, evaluation_seeds, tell


def run(config, theta, function, scope=ALL):
    for update in range(config.updates):
        asked = ask(config, update, scope)
        values = np.array([function(perturbation.candidate(theta)) for perturbation, _ in asked])
        theta = tell(config, update, theta, values.reshape(-1, 2), scope)
    return theta


def test_it_climbs():
    target = np.linspace(-1, 1, 20)
    theta = run(
        SearchConfig(updates=300, directions=8, alpha=(0.1, 0.01), sigma=(0.05, 0.01)),
        np.zeros(20, np.float32),
        lambda x: -float(np.square(x - target).sum()),
    )
    assert np.square(theta - target).sum() < 0.05 * np.square(target).sum()


def test_one_update_is_the_formula():
    config = SearchConfig(updates=5, directions=3, alpha=(0.5, 0.1), sigma=(0.2, 0.1), seed=7)
    theta = np.linspace(0, 1, 11).astype(np.float32)
    objectives = np.array([[3.0, 1.0], [2.0, 2.0], [0.0, 5.0]])
    deltas = np.stack([direction(7, 2, i, 11) for i in range(3)]).astype(np.float64)
    step = (objectives[:, 0] - objectives[:, 1]) @ deltas
    expected = theta + 0.3 / (3 * objectives.std()) * step
    np.testing.assert_allclose(tell(config, 2, theta, objectives), expected, rtol=1e-6)


def test_a_paired_spread_does_not_see_what_both_sides_share():
    config = SearchConfig(updates=5, directions=3, alpha=(0.5, 0.1), sigma=(0.2, 0.1), seed=7, paired_spread=True)
    theta = np.linspace(0, 1, 11).astype(np.float32)
    objectives = np.array([[3.0, 1.0], [2.0, 2.0], [0.0, 5.0]])
    deltas = np.stack([direction(7, 2, i, 11) for i in range(3)]).astype(np.float64)
    half = (objectives[:, 0] - objectives[:, 1]) / 2
    expected = theta + 0.3 / (3 * np.sqrt(np.mean(half**2))) * 2 * half @ deltas
    moved = tell(config, 2, theta, objectives)
    np.testing.assert_allclose(moved, expected, rtol=1e-6)
    # easy and hard seeds, and pairs that were dropped
    shared = objectives + np.array([[100.0], [-50.0], [7.0]])
    np.testing.assert_allclose(tell(config, 2, theta, shared), moved, rtol=1e-6)
    ties = np.array([[3.0, 3.0], [np.nan, np.nan], [-8.0, -8.0]])
    assert np.array_equal(tell(config, 2, theta, ties), theta)


def test_dropped_pairs_leave_the_formula_of_the_rest():
    config = SearchConfig(updates=5, directions=4, alpha=(0.5, 0.1), sigma=(0.2, 0.1), seed=7)
    theta = np.linspace(0, 1, 11).astype(np.float32)
    objectives = np.array([[3.0, 1.0], [np.nan, np.nan], [2.0, 2.5], [0.0, 5.0]])
    kept = [0, 2, 3]
    deltas = np.stack([direction(7, 2, i, 11) for i in kept]).astype(np.float64)
    step = (objectives[kept, 0] - objectives[kept, 1]) @ deltas
    expected = theta + 0.3 / (3 * objectives[kept].std()) * step
    np.testing.assert_allclose(tell(config, 2, theta, objectives), expected, rtol=1e-6)


def test_equal_objectives_leave_theta():
    theta = np.ones(4, np.float32)
    assert tell(SearchConfig(directions=2), 0, theta, np.full((2, 2), 3.0)).tobytes() == theta.tobytes()


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**63 - 1), st.integers(0, 10**6), st.integers(0, 65535), st.integers(1, 300))
def test_a_direction_is_a_function_of_its_key(seed, update, index, d):
    first = direction(seed, update, index, d)
    assert first.dtype == np.float32 and first.shape == (d,)
    assert first.tobytes() == direction(seed, update, index, d).tobytes()
    for other in ((seed ^ 1, update, index), (seed, update + 1, index), (seed, update, index + 1)):
        assert first.tobytes() != direction(*other, d).tobytes()
    assert 0 <= episode_seed(seed, update, index) < 2**31


def test_directions_are_standard_normal_and_independent():
    x = np.stack([direction(0, k, i, 1000) for k in range(5) for i in range(20)]).astype(np.float64)
    assert abs(x.mean()) < 0.01 and abs(x.std() - 1) < 0.01
    correlation = np.corrcoef(x)[np.triu_indices(100, 1)]
    assert abs(correlation).max() < 0.2 and abs(correlation.std() - 1000**-0.5) < 0.003


def test_both_sides_share_the_seed_and_the_evaluation_has_others():
    asked = ask(SearchConfig(updates=3, directions=50), 1)
    plus, minus = asked[::2], asked[1::2]
    assert [seed for _, seed in plus] == [seed for _, seed in minus]
    assert len({seed for _, seed in plus}) == 50
    assert {p.sign for p, _ in plus} == {1} and {p.sign for p, _ in minus} == {-1}
    theta = np.zeros(30, np.float32)
    np.testing.assert_array_equal(plus[3][0].candidate(theta), -minus[3][0].candidate(theta))
    assert not {seed for _, seed in asked} & set(evaluation_seeds(0, 100))


def test_schedules_are_linear_from_first_to_last():
    config = SearchConfig(updates=200)
    assert (config.alpha_at(0), config.sigma_at(0)) == (0.02, 0.025)
    assert config.alpha_at(199) == pytest.approx(0.002) and config.sigma_at(199) == pytest.approx(0.0025)
    assert config.alpha_at(100) == pytest.approx(0.02 - 0.018 * 100 / 199)
    assert SearchConfig(updates=1).alpha_at(0) == 0.02


def test_the_last_layer_alone_moves():
    theta = np.ones(10, np.float32)
    moved = run(SearchConfig(updates=2, directions=2), theta, lambda x: float(x.sum()), Scope(7))
    assert (moved[:7] == 1).all() and (moved[7:] != 1).all()
    assert (Perturbation(0, 0, 0, 1, 0.1, Scope(7)).candidate(theta)[:7] == 1).all()


def test_gains_scale_the_rows_of_the_last_layer():
    """Five parameters before it, then 2 x 3 weights and 2 biases."""
    scope, theta = Scope(5, 2), np.linspace(0.5, 3.0, 13).astype(np.float32)
    rows = np.array([0, 0, 0, 1, 1, 1, 0, 1])
    delta = direction(4, 2, 1, 2)
    candidate = Perturbation(4, 2, 1, -1, 0.25, scope).candidate(theta)
    assert np.array_equal(candidate[:5], theta[:5])
    assert np.array_equal(candidate[5:], theta[5:] * (np.float32(1.0) + np.float32(-0.25) * delta)[rows])
    config = SearchConfig(directions=3, alpha=(0.1, 0.1), seed=4)
    objectives = np.array([[3.0, 1.0], [2.0, 2.0], [0.0, 5.0]])
    deltas = np.stack([direction(4, 2, i, 2) for i in range(3)]).astype(np.float64)
    step = 0.1 / (3 * objectives.std()) * (objectives[:, 0] - objectives[:, 1]) @ deltas
    moved = tell(config, 2, theta, objectives, scope)
    assert np.array_equal(moved[:5], theta[:5])
    np.testing.assert_allclose(moved[5:], theta[5:] * (1.0 + step)[rows], rtol=1e-6)


def test_gains_find_the_loop_that_does_not_shake():
    """The best of the gains is 0.4 and 0.7 of where they begin; nothing else can move."""
    scope, theta = Scope(3, 2), np.ones(3 + 2 * 5, np.float32)
    theta = run(
        SearchConfig(updates=60, directions=4, alpha=(0.1, 0.01), sigma=(0.15, 0.05)),
        theta,
        lambda x: -float((x[3] - 0.4) ** 2 + (x[-1] - 0.7) ** 2),
        scope,
    )
    assert np.allclose(theta[[3, 6, 11]], 0.4, atol=0.05) and np.allclose(theta[[7, 10, 12]], 0.7, atol=0.05)
    assert (theta[:3] == 1).all()


def test_only_the_best_directions_count():
    """Of four, one dropped: the two whose better side is best, as if there were no others."""
    config, theta = SearchConfig(directions=4, top=2), np.zeros(6, np.float32)
    objectives = np.array([[9.0, 0.0], [np.nan, np.nan], [1.0, 2.0], [-5.0, 3.0]])
    alone = np.array([[9.0, 0.0], [np.nan] * 2, [np.nan] * 2, [-5.0, 3.0]])
    expected = tell(SearchConfig(directions=4), 0, theta, alone)
    assert np.array_equal(tell(config, 0, theta, objectives), expected) and expected.any()
    # as many as are left, or none chosen: all
    for top in (3, 4, 0):
        same = tell(replace(config, top=top), 0, theta, objectives)
        assert np.array_equal(same, tell(SearchConfig(directions=4), 0, theta, objectives))


def test_memory_is_of_one_direction_not_of_all():
    d = 130_000
    theta, objectives = np.zeros(d, np.float32), np.random.default_rng(0).normal(size=(64, 2))
    tracemalloc.start()
    tell(SearchConfig(directions=64), 0, theta, objectives)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 * d * 4  # the matrix of directions would be 64 times d


@pytest.mark.parametrize(
    "arguments",
    [{"updates": 0}, {"directions": 0}, {"directions": 10**9}, {"seed": -1}, {"alpha": (0.1, float("nan"))},
     {"alpha": (-0.1, 0.1)}, {"top": 65_537}, {"top": -1}, {"sigma": (0.0, 0.1)}, {"sigma": (0.1, float("inf"))},
     {"last_layer": True, "action_gains": True}],
)  # fmt: skip
def test_settings_out_of_range_are_named(arguments):
    with pytest.raises(UsageError, match=next(iter(arguments))):
        SearchConfig(**arguments)


@pytest.mark.parametrize(
    "objectives",
    [
        np.zeros((3, 2)),
        np.full((2, 2), np.nan),
        np.zeros(4),
        np.array([[0.0, np.nan], [1.0, 2.0]]),
        np.array([[np.inf, np.inf], [1.0, 2.0]]),
    ],
)
def test_objectives_that_do_not_fit(objectives):
    with pytest.raises(ValueError):
        tell(SearchConfig(directions=2), 0, np.zeros(3, np.float32), objectives)
