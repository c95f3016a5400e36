import numpy as np
import pytest

from drs_core.measures.statistics import mean_interval, percent_interval


def test_the_bootstrap_interval_covers_the_mean_about_95_times_in_100():
    rng, covered = np.random.default_rng(0), 0
    for _ in range(120):
        low, high = mean_interval(rng.exponential(size=80))
        covered += low <= 1.0 <= high
    assert 105 <= covered <= 119


def test_the_same_values_give_the_same_interval_and_equal_values_a_point():
    values = np.arange(30.0)
    assert mean_interval(values) == mean_interval(values)
    assert mean_interval([3.0, 3.0]) == (3.0, 3.0)
    assert mean_interval([3.0]) == (3.0, 3.0)


def test_wilson():
    # Newcombe (1998), table I: 81 of 263
    low, high = percent_interval(81, 263)
    assert (low, high) == pytest.approx((25.53, 36.62), abs=0.01)
    assert percent_interval(0, 100)[0] == pytest.approx(0.0, abs=1e-12) and percent_interval(0, 100)[1] > 3
