"""The shipped agents are small, whole, and as good as their README says."""

import pytest

from drs_core.agent import load
from drs_core.agents import FOLDER, shipped
from drs_core.evaluation import evaluate, summary
from drs_core.rollouts import ProcessPool


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_agent_is_small_and_documented(name):
    assert shipped()[name].stat().st_size < 350_000
    source = load(shipped()[name]).source
    assert source["trained_by"] == "drs train"
    assert source["wall_s"] > 0 and source["settings"]["seed"] == source["seed"]
    assert source["evaluation"]["episodes"] >= 20
    assert name in (FOLDER / "README.md").read_text()


def test_panda_reach_reaches_and_shakes():
    agent = load(shipped()["panda_reach"])
    with ProcessPool(agent, 2) as pool:
        result = summary(evaluate("panda_reach", agent, pool, 100, 0))
    assert result["success_percent"] == 100.0
    assert result["tip_speed_mean"] > 0.2


def test_panda_slide_often_gets_the_puck_there():
    agent = load(shipped()["panda_slide"])
    with ProcessPool(agent, 2) as pool:
        assert summary(evaluate("panda_slide", agent, pool, 60, 0))["success_percent"] >= 40.0


@pytest.mark.parametrize("name", ["panda_push", "panda_pick_and_place"])
def test_an_agent_that_moves_a_cube_mostly_gets_it_there(name):
    agent = load(shipped()[name])
    with ProcessPool(agent, 2) as pool:
        assert summary(evaluate(name, agent, pool, 40, 0))["success_percent"] >= 85.0
