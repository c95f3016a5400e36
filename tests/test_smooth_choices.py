"""`scripts/smooth_choices.py`: what each objective is worth, by hand."""

import numpy as np
import pytest
from smooth_choices import CHOICES, Baseline, Choice

from drs_core.episode import Episode
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.objective import Objective
from tests.conftest import make_agent


def episode(return_, change, dimension):
    actions = np.cumsum([[0.0], [0.0], *[[2 * change * (-1) ** i] for i in range(2)]], axis=0).astype(np.float32)
    seen = np.random.default_rng(0).normal(size=(40, 2)).astype(np.float32)
    measured = MeshDimension(dimension, dimension, 5.0)
    return Episode(7, return_, 40, False, False, None, change, measured, actions=actions, seen=seen)


def value(name, one):
    episodes = [episode(-1.0, 0.4, 2.0), episode(-3.0, 0.2, 3.0)]
    make, asks, _ = CHOICES[name]
    objective: Objective = Choice(name, value=make(Baseline(make_agent(), episodes, lambda seed: -2.0)), asks=asks)
    assert objective.measures == asks and not objective.needs_baseline
    return objective(one)


def test_what_each_is_worth():
    one = episode(-2.5, 0.15, 1.5)
    # R has a standard deviation of 1, A a mean of 0.3, D one of 2.5
    assert value("R-3sd*A", one) == pytest.approx(-2.5 - 3 * 0.15 / 0.3)
    assert value("R-1.5sd*log(A)", one) == pytest.approx(-2.5 - 1.5 * np.log(0.15))
    assert value("R*D", one) == pytest.approx(-2.5 * 1.5)
    assert value("R*max(D,D0)", one) == pytest.approx(-2.5 * 2.5)
    # half a unit of return was lost
    assert value("least_A,R>=R0", one) == pytest.approx(-0.15 / 0.3 - 0.5)
    assert value("least_A,R>=R0", episode(-1.0, 0.15, 1.5)) == pytest.approx(-0.15 / 0.3)


def test_the_second_half_is_where_an_arm_stays():
    # the baseline's late changes: 0.8 and 0.4; one's: 0.3
    assert value("R-3sd*late(A)", episode(-2.5, 0.15, 1.5)) == pytest.approx(-2.5 - 3 * 0.3 / 0.6)


@pytest.mark.parametrize("name", CHOICES)
def test_every_one_has_a_value(name):
    assert np.isfinite(value(name, episode(-2.5, 0.15, 1.5)))
