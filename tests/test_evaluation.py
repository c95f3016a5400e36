from dataclasses import replace

import numpy as np
import pytest

from drs_core.episode import Episode
from drs_core.errors import UsageError
from drs_core.evaluation import Evaluation, comparison, evaluate, summary, typical_seed
from drs_core.importing import resolve
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.measures.smoothness import TipMotion
from drs_core.rollouts import InProcess, ProcessPool
from tests.conftest import make_agent

CONTRACT = (
    "agent environment episodes seed return_mean return_std return_ci95 length_mean failure_percent failure_ci95 "
    "success_percent dimension_mean dimension_std dimension_lower_mean dimension_upper_mean action_change_mean "
    "rollouts_per_second steps_per_second"
).split()
PANDA = "tip_speed_mean tip_jerk_mean_square tip_position_std velocity_sign_flips log_dimensionless_jerk".split()


def evaluation(returns, environment="HopperBulletEnv-v0", failed=(), first=0):
    episodes = [
        Episode(first + i, r, 10, i in failed, i in failed, None, 0.1, MeshDimension(1.0, 3.0, 5.0))
        for i, r in enumerate(returns)
    ]
    return Evaluation("x", environment, 0, episodes, 2.0)


def test_a_summary_has_the_keys_of_the_contract_and_the_right_numbers():
    result = summary(evaluation([1.0, 2.0, 3.0, 6.0], failed={1}))
    assert set(CONTRACT) <= set(result) and not set(PANDA) & set(result)
    assert (result["return_mean"], result["return_std"]) == (3.0, pytest.approx(np.std([1, 2, 3, 6])))
    assert result["return_ci95"][0] < 3.0 < result["return_ci95"][1]
    assert result["failure_percent"] == 25.0 and result["success_percent"] is None
    assert (result["dimension_mean"], result["dimension_lower_mean"], result["dimension_upper_mean"]) == (2, 1, 3)
    assert (result["rollouts_per_second"], result["steps_per_second"]) == (2.0, 20.0)


def test_comparison_is_paired():
    before = np.random.default_rng(0).normal(0, 100, 50)
    result = comparison(evaluation(before), evaluation(before + 1 + 0.1 * np.sin(np.arange(50))))
    # unpaired, a difference of 1 would drown in a spread of 100
    assert result["probability_after_better"] == 1.0
    assert result["differences"]["return"]["ci95"][0] > 0.9
    assert result["differences"]["action_change"]["probability_after_better"] == 0.5
    assert result["differences"]["dimension"]["mean"] == 0.0
    assert (result["episodes_better"], result["episodes_equal"], result["episodes_worse"]) == (50, 0, 0)
    same = comparison(evaluation(before), evaluation(before))
    assert same["probability_after_better"] == 0.5 and same["episodes_equal"] == 50


def test_less_motion_is_better_and_the_median_episode_is_typical():
    def moving(speeds):
        made = evaluation([-1.0] * len(speeds), "PandaReach-v3")
        motions = [TipMotion(speed, speed, speed, 0.0, 0.0) for speed in speeds]
        episodes = [replace(e, motion=m) for e, m in zip(made.episodes, motions, strict=True)]
        return replace(made, episodes=episodes)

    before, after = moving([0.5, 0.1, 0.3, 0.2, 0.4]), moving([0.1, 0.1, 0.1, 0.1, 0.1])
    differences = comparison(before, after)["differences"]
    assert differences["tip_speed"]["mean"] == pytest.approx(-0.2)
    assert differences["tip_speed"]["probability_after_better"] > 0.99
    assert typical_seed(before) == 2


def test_what_cannot_be_compared():
    with pytest.raises(UsageError):
        comparison(evaluation([1.0]), evaluation([1.0], "AntBulletEnv-v0"))
    with pytest.raises(UsageError):
        comparison(evaluation([1.0]), evaluation([1.0], first=5))


def test_the_numbers_do_not_depend_on_the_workers():
    agent = resolve("panda_reach")
    here = summary(evaluate("x", agent, InProcess(agent), 4, 7))
    with ProcessPool(agent, 2) as pool:
        there = summary(evaluate("x", agent, pool, 4, 7))
    assert set(CONTRACT + PANDA) <= set(here)
    for key, value in here.items():
        assert key.endswith("per_second") or value == there[key], key


@pytest.mark.parametrize(("episodes", "seed"), [(0, 0), (10**9, 0), (1, -1), (1, 2**63)])
def test_numbers_out_of_range(episodes, seed):
    agent = make_agent()
    with pytest.raises(UsageError):
        evaluate("x", agent, InProcess(agent), episodes, seed)


# facts measured elsewhere on 100 episodes: mean and standard deviation of the return, failure percent
BASELINES = {
    "a2c/MountainCarContinuous-v0": (91.1, 0.3, 0),
    "ddpg/MountainCarContinuous-v0": (93.5, 0.1, 0),
    "sac/MountainCarContinuous-v0": (94.6, 1.2, 0),
    "tqc/PandaReach-v1": (-1.70, 0.85, 0),
    "a2c/HopperBulletEnv-v0": (815, 289, 95),
}


@pytest.mark.parametrize("name", BASELINES)
def test_baselines_of_real_agents(shared, name):
    mean, std, failures = BASELINES[name]
    agent = resolve(str(shared / "agents" / f"{name}_1"))
    n = 30
    with ProcessPool(agent, 2) as pool:
        result = summary(evaluate(name, agent, pool, n, 0))
    error = 3 * np.hypot(std, result["return_std"]) * (1 / n + 1 / 100) ** 0.5
    assert abs(result["return_mean"] - mean) < error + 0.1
    assert abs(result["failure_percent"] - failures) <= 15
