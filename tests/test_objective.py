import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.episode import Episode
from drs_core.errors import UsageError
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.objective import KAPPA, Objective, smoothness_weight

DIMENSION = MeshDimension(2.0, 4.0, 8.0)


def episode(return_, dimension=DIMENSION, action_change=0.25):
    return Episode(0, return_, 10, False, False, None, action_change, dimension)


def test_objectives():
    assert Objective()(episode(12.0)) == 12.0
    assert Objective("dimension")(episode(12.0)) == 4.0
    assert Objective("dimension")(episode(-12.0)) == -36.0
    assert Objective("dimension")(episode(12.0, MeshDimension(2.0, 40.0, 8.0))) == 12.0 / 5.0
    assert Objective("smooth", 4.0)(episode(12.0)) == 11.0
    assert abs(Objective("dimension")(episode(12.0, MeshDimension(0.0, 0.0, 8.0)))) < 1e6


def test_smooth_takes_its_weight_from_the_baseline():
    baseline = [episode(-1.0, action_change=0.1), episode(-3.0, action_change=0.3)]
    objective = Objective("smooth").weighed(baseline)
    assert objective.smoothness_weight == pytest.approx(KAPPA * 1.0 / 0.2)
    # the baseline's whole action change is worth KAPPA standard deviations of its return
    assert objective(episode(-2.0, action_change=0.2)) == pytest.approx(-2.0 - KAPPA)
    with pytest.raises(ValueError, match="weight"):
        Objective("smooth")(episode(1.0))
    assert not Objective("smooth", 0.0).needs_baseline and not Objective("return").needs_baseline


@given(st.lists(st.integers(-1000, 1000), min_size=2, max_size=40), st.integers(-30, 30), st.integers(-1000, 1000))
def test_the_weight_follows_the_unit_of_the_reward_and_not_its_zero(returns, power, offset):
    changes, unit = [0.25] * len(returns), 2.0**power
    weight = smoothness_weight(returns, changes)
    assert Objective("smooth", weight).smoothness_weight == weight > 0.0
    if len(set(returns)) > 1:
        assert smoothness_weight([unit * value + unit * offset for value in returns], changes) == unit * weight


def test_the_weight_where_there_is_nothing_to_weigh():
    assert smoothness_weight([-2.0, -2.0], [0.1, 0.3]) == pytest.approx(KAPPA * 2.0 / 0.2)
    assert smoothness_weight([0.0, 0.0], [0.1, 0.3]) == 1.0
    assert smoothness_weight([5.0, 4.0], [0.0, 0.0]) == 0.0


@pytest.mark.parametrize("arguments", [("retrun",), ("smooth", -1.0), ("smooth", float("nan"))])
def test_what_is_no_objective(arguments):
    with pytest.raises(UsageError):
        Objective(*arguments)


def test_only_what_is_needed_is_measured():
    assert Objective("return").measures == Objective("smooth").measures == frozenset()
    assert Objective("dimension").measures == {"dimension"}
    with pytest.raises(ValueError):
        Objective("dimension")(episode(1.0, None))
