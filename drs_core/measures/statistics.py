"""Means, percentages and their 95 % intervals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

CONFIDENCE = 0.95
RESAMPLES = 9999
_LARGEST_BATCH = 10_000_000


class Interval(NamedTuple):
    """Lower and upper end of a 95 % confidence interval."""

    low: float
    high: float


def mean_interval(values: ArrayLike) -> Interval:
    """Percentile bootstrap interval of the mean of values (n,), with a fixed seed (Efron, 1979)."""
    sample = np.asarray(values, dtype=np.float64)
    if np.ptp(sample) == 0.0:
        return Interval(float(sample[0]), float(sample[0]))
    low, high = np.quantile(resampled_means(sample), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Interval(float(low), float(high))


def resampled_means(sample: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of RESAMPLES bootstrap resamples of a sample (n,), n >= 2."""
    from scipy import stats

    result = stats.bootstrap(
        (sample,),
        np.mean,
        n_resamples=RESAMPLES,
        batch=max(1, _LARGEST_BATCH // len(sample)),
        method="percentile",
        rng=np.random.default_rng(0),
    )
    return np.asarray(result.bootstrap_distribution, dtype=np.float64)


def percent_interval(count: int, total: int) -> Interval:
    """Wilson's interval of 100 * count / total (Wilson, 1927)."""
    from scipy import stats

    interval = stats.binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(100.0 * float(interval.low), 100.0 * float(interval.high))


def percent_difference_interval(count: int, total: int, other_count: int, other_total: int) -> Interval:
    """Newcombe's hybrid score interval of 100 * (count / total - other_count / other_total).

    Source: Newcombe, Interval estimation for the difference between independent proportions (1998), method 10.
    """
    p, q = 100.0 * count / total, 100.0 * other_count / other_total
    (p_low, p_high), (q_low, q_high) = percent_interval(count, total), percent_interval(other_count, other_total)
    below, above = math.hypot(p - p_low, q_high - q), math.hypot(p_high - p, q - q_low)
    return Interval(p - q - below, p - q + above)
