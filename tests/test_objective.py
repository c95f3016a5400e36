import pytest

from drs_core.episode import Episode
from drs_core.errors import UsageError
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.objective import Objective

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


def test_smooth_has_a_default_weight_for_panda_only():
    assert Objective("smooth").for_environment("PandaPush-v3").smoothness_weight == 5.0
    assert Objective("smooth", 2.0).for_environment("HopperBulletEnv-v0").smoothness_weight == 2.0
    with pytest.raises(UsageError, match="smoothness_weight"):
        Objective("smooth").for_environment("HopperBulletEnv-v0")


@pytest.mark.parametrize("arguments", [("retrun",), ("smooth", -1.0), ("smooth", float("nan"))])
def test_what_is_no_objective(arguments):
    with pytest.raises(UsageError):
        Objective(*arguments)


def test_only_what_is_needed_is_measured():
    assert Objective("return").measures == Objective("smooth").measures == frozenset()
    assert Objective("dimension").measures == {"dimension"}
    with pytest.raises(ValueError):
        Objective("dimension")(episode(1.0, None))
