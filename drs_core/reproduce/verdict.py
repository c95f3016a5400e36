"""Ours against the paper's, and against our own baseline. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.measures.statistics import Interval, mean_interval, percent_difference_interval, percent_interval
from drs_core.reproduce.paper import DIMENSION, FAILURE, RETURN, Printed

BETTER, EQUAL, WORSE = "better", "equal", "worse"

SIGN = {RETURN: 1, DIMENSION: -1, FAILURE: -1}
"""+1 where more is better."""
ROUNDING = {RETURN: 0.5, DIMENSION: 0.005, FAILURE: 0.0}
"""Half a unit of the last printed digit; of failures the printed percentage gives the count exactly."""
Z = 1.96

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Verdict:
    """Ours minus the paper's, its 95 % interval, and what that says."""

    difference: float
    interval: Interval
    mark: str


def mark(interval: Interval, sign: int) -> str:
    """Whether a difference is better or worse beyond doubt."""
    if interval.low <= 0.0 <= interval.high:
        return EQUAL
    return BETTER if (interval.low > 0.0) == (sign > 0) else WORSE


def against_paper(quantity: str, ours: Values, printed: Printed, trials: int) -> Verdict:
    """Compare (episodes,) values with a printed mean of `trials` episodes.

    Means: 1.96 standard errors of the difference, and the rounding of the printed mean. Failures:
    Newcombe's interval for the difference of two proportions.
    """
    difference = float(ours.mean()) - printed.mean
    if quantity == FAILURE:
        counts = (round(float(ours.sum()) / 100.0), len(ours), round(printed.mean * trials / 100.0), trials)
        interval = percent_difference_interval(*counts)
    else:
        variance = float(ours.var(ddof=1)) / len(ours) + (printed.std or 0.0) ** 2 / trials
        error = Z * variance**0.5 + ROUNDING[quantity]
        interval = Interval(difference - error, difference + error)
    return Verdict(difference, interval, mark(interval, SIGN[quantity]))


def own_interval(quantity: str, ours: Values) -> Interval:
    """95 % interval of the mean of (episodes,) values."""
    if quantity == FAILURE:
        return percent_interval(round(float(ours.sum()) / 100.0), len(ours))
    return mean_interval(ours)


def gain(before: Values, after: Values) -> tuple[float, Interval]:
    """After minus before on the same seeds, both (episodes,), and its 95 % interval."""
    difference = after - before
    return float(difference.mean()), mean_interval(difference)
