"""What is said of an episode's length without making the environment is what the environment has."""

from contextlib import closing

import pytest

from drs_core.environments import PAPER, Environment
from drs_core.environments.robot_state import period_s
from drs_core.environments.timing import episode_time


@pytest.mark.parametrize("name", PAPER)
def test_it_is_that_of_the_environment(name):
    time = episode_time(name)
    if name.startswith("MountainCar"):
        assert time is None
        return
    with closing(Environment(name)) as environment:
        assert time.steps == environment.spaces.time_limit_steps
        assert time.step_s == pytest.approx(period_s(environment), rel=1e-9)


def test_in_words():
    assert str(episode_time("PandaReach-v3")) == "2 s (50 steps at 25 Hz)"
    assert episode_time("Pendulum-v1") is None
