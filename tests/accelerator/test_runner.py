"""Bad input ends in a sentence, never in a crash; two threads take turns."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from drs_core.accelerator import make_runner
from drs_core.accelerator.compiled import CompiledRunner
from drs_core.environments import Environment
from drs_core.episode import DIMENSION, MOTION, TRAJECTORY, EpisodeRunner
from drs_core.errors import DrsError, UsageError
from tests.conftest import make_agent

pytestmark = pytest.mark.usefixtures("built")
HOPPER = "HopperBulletEnv-v0"


@pytest.fixture
def runner():
    environment = Environment(HOPPER)
    yield CompiledRunner(make_agent(HOPPER), environment)
    environment.close()


@pytest.mark.parametrize("shape", [(0, 3), (5, 2), (5, 4), (5,), (1001, 3), (5, 3, 1)])
def test_actions_of_a_wrong_shape(runner, shape):
    with pytest.raises(UsageError, match="shape"):
        runner.replay(1, np.zeros(shape, dtype=np.float32))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_actions_that_are_not_finite(runner, bad):
    actions = np.zeros((10, 3), dtype=np.float32)
    actions[4, 1] = bad
    with pytest.raises(DrsError, match="not finite"):
        runner.replay(1, actions)
    assert len(runner.replay(1, actions[:4]).rewards) == 4


@pytest.mark.parametrize("steps", [0, -1, 1001])
def test_numbers_of_steps_that_do_not_fit(runner, steps):
    with pytest.raises(UsageError, match=r"1\.\.1000"):
        runner.rollout(1, steps)


def test_nothing_runs_in_a_closed_world(runner):
    runner._environment.close()
    another = Environment(HOPPER)  # of the same number in PyBullet
    with pytest.raises(UsageError, match="was closed"):
        runner.run(1)
    another.close()


def test_runners_of_one_world_do_not_disturb_each_other(runner):
    other = CompiledRunner(make_agent(HOPPER, seed=1), runner._environment)
    expected = [one.run(3).return_ for one in (runner, other)]
    assert [one.run(3).return_ for one in (runner, other, runner)] == [*expected, expected[0]]
    assert expected[0] != expected[1]


def test_a_structure_of_wrong_sizes_is_refused_by_the_helper(runner):
    robot = runner._robot.structure
    for field, value in (("n_joints", 33), ("n_parts", 0), ("n_feet", -1), ("n_bruising", 9), ("torso_link", 99)):
        right = getattr(robot, field)
        setattr(robot, field, value)
        with pytest.raises(DrsError, match="sizes differ"):
            runner.run(1)
        setattr(robot, field, right)
    runner._policy._arrays["sizes"][1] = 70000
    with pytest.raises(DrsError, match="sizes differ"):
        runner.run(1)


def test_an_episode_has_what_the_plain_one_has():
    agent = make_agent(HOPPER)
    compiled, plain = make_runner(agent, "compiled"), EpisodeRunner(agent)
    measure = frozenset({DIMENSION, MOTION, TRAJECTORY})
    # short episodes: rounding has no time to grow
    for seed in range(5):
        one, other = compiled.run(seed, measure), plain.run(seed, measure)
        assert one.length == other.length < 100
        assert (one.terminated, one.failed, one.success) == (other.terminated, other.failed, other.success)
        assert (one.motion, one.tip_position, one.tip_velocity) == (None, None, None)
        np.testing.assert_allclose(one.return_, other.return_, rtol=1e-3)
        np.testing.assert_allclose(one.action_change, other.action_change, rtol=1e-3)
        np.testing.assert_allclose(one.dimension.bounds(), other.dimension.bounds(), rtol=0.05)
        assert compiled.run(seed).dimension is None
    compiled.close()
    plain.close()


def test_two_threads_take_turns():
    agent = make_agent(HOPPER)
    runners = [make_runner(agent, "compiled") for _ in range(2)]
    expected = [runners[0].run(seed).return_ for seed in range(20)]
    barrier = threading.Barrier(2)

    def run(runner):
        barrier.wait()
        return [runner.run(seed).return_ for seed in range(20)]

    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(run, runners)) == [expected, expected]
    for runner in runners:
        runner.close()
