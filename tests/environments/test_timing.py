"""The clock of an environment: the catalogue's is upstream's, and any other's is what it states itself."""

import gymnasium
import numpy as np
import pytest

from drs_core.environments import PAPER, Environment, Timing, timing
from drs_core.errors import UsageError


def upstream_period_s(environment_id, env):
    """From the simulator's own settings."""
    if environment_id.startswith("Panda"):
        return env.sim.dt
    if "Bullet" in environment_id:
        env.reset(seed=0)
        return env.scene.dt
    return 1 / env.metadata["render_fps"]


@pytest.mark.parametrize("environment_id", PAPER)
def test_the_catalogue_says_what_upstream_does(environment_id):
    found, environment = timing(environment_id), Environment(environment_id, fast=False)
    assert found.limit_steps == environment.spaces.time_limit_steps
    assert found.period_s == pytest.approx(upstream_period_s(environment_id, environment.unwrapped), rel=1e-12)
    environment.close()


def test_box2d_steps_its_world_by_the_period():
    """`render_fps` is the physics' rate there, not only the drawing's."""
    from gymnasium.envs.box2d import bipedal_walker, lunar_lander

    assert timing("LunarLanderContinuous-v3").period_s == 1 / lunar_lander.FPS
    assert timing("BipedalWalker-v3").period_s == 1 / bipedal_walker.FPS


def test_an_old_name_has_the_clock_of_todays():
    assert timing("PandaReach-v1") == timing("PandaReach-v3") == Timing(0.04, 50)
    assert timing("PandaReach-v1").episode_s == 2.0


def test_another_id_states_its_own():
    assert timing("Pendulum-v1") == Timing(1 / 30, 200)
    assert timing("PandaReachDense-v3") == Timing(0.04, 50)


class Stated(gymnasium.Env):
    observation_space = action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, rate=None):
        if rate is not None:
            self.metadata = {"render_fps": rate}


@pytest.fixture
def stating():
    def register(rate):
        gymnasium.register("Stated-v0", lambda: Stated(rate))
        return "Stated-v0"

    yield register
    gymnasium.registry.pop("Stated-v0", None)


@pytest.mark.parametrize("rate", [None, 0, -5, float("nan"), float("inf"), 1e300, True, "60", [60], 1 << 2000])
def test_one_that_states_no_rate_is_refused_with_the_mend(stating, rate):
    with pytest.raises(UsageError, match=r"no control rate.*number of updates") as error:
        timing(stating(rate))
    assert len(str(error.value)) < 250


def test_one_without_a_time_limit_ends_where_drs_ends_it(stating):
    assert timing(stating(100)) == Timing(0.01, 1000)
