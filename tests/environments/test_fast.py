"""Fast stepping gives upstream's bits: whole episodes, side by side with the plain environment."""

import logging
from collections import Counter
from contextlib import closing

import numpy as np
import pytest

from drs_core.environments import PAPER, Environment
from drs_core.environments.catalogue import entry
from drs_core.environments.fast import proved
from drs_core.environments.robot_state import read_state, take_joint_targets, take_tip_targets
from drs_core.importing import resolve
from drs_core.training.teachers import TEACHERS, act

FAST = [name for name in PAPER if entry(name).family in ("locomotion", "panda")]
LOCOMOTION = [name for name in FAST if entry(name).family == "locomotion"]
PANDA = [name for name in FAST if entry(name).family == "panda"]
ROBOT = ("body_xyz", "body_real_xyz", "body_rpy", "walk_target_theta", "walk_target_dist", "initial_z",
         "joints_at_limit", "joint_speeds", "feet_contact")  # fmt: skip
EPISODE = ("potential", "_alive", "rewards", "reward")


def facts(observation):
    """Type, shape and bits of an observation."""
    parts = observation.items() if isinstance(observation, dict) else [("", observation)]
    return [(key, value.dtype, value.shape, value.tobytes()) for key, value in parts]


def upstream_state(environment):
    """What upstream's objects hold after a step, as bits."""
    env = environment.unwrapped
    if environment.id.startswith("Panda"):
        bodies = [env.sim.physics_client.getBasePositionAndOrientation(body) for body in env.sim._bodies_idx.values()]
        return [env.task.goal.tobytes(), bodies, read_state(environment).positions.tobytes()]
    values = [getattr(env.robot, name) for name in ROBOT] + [getattr(env, name) for name in EPISODE]
    return [np.asarray(value).astype(np.float64).tobytes() for value in values]


def facts_of(step):
    return facts(step.observation), type(step.reward), np.float64(step.reward).tobytes(), step[2:]


def side_by_side(fast, plain, seed, policy):
    """One episode on both; returns the steps that the plain one took."""
    observation = fast.reset(seed)
    assert facts(observation) == facts(plain.reset(seed))
    steps = []
    while True:
        action = policy(observation, len(steps))
        taken = fast.step(action)
        steps.append(plain.step(action))
        assert facts_of(taken) == facts_of(steps[-1]), (seed, len(steps))
        assert upstream_state(fast) == upstream_state(plain), (seed, len(steps))
        if taken.terminated or taken.truncated:
            return steps
        observation = taken.observation


@pytest.fixture
def pair(request):
    with closing(Environment(request.param)) as fast, closing(Environment(request.param, fast=False)) as plain:
        assert fast.is_fast and not plain.is_fast
        yield fast, plain


def scripted(environment, seed):
    """Random actions; where there is one, the teacher: it pushes, grasps and taps."""
    rng = np.random.default_rng(seed)
    low, high = environment.spaces.low, environment.spaces.high

    def policy(observation, step):
        if environment.id in TEACHERS:
            return act(TEACHERS[environment.id], observation, seed, step)
        return rng.uniform(low, high).astype(np.float32)

    return policy


@pytest.mark.parametrize("pair", FAST, indirect=True)
def test_episodes_of_scripted_policies_are_equal_in_any_order_of_seeds(pair):
    fast, plain = pair
    steps = {seed: side_by_side(fast, plain, seed, scripted(plain, seed)) for seed in (4, 1, 4, 9)}
    parts = [np.array([step.observation["observation"] for step in episode]) for episode in steps.values()
             if isinstance(episode[0].observation, dict)]  # fmt: skip
    if fast.id in ("PandaPush-v3", "PandaSlide-v3"):
        assert all(np.ptp(states[:, 6], 0) > 0.01 or np.ptp(states[:, 7], 0) > 0.01 for states in parts)
    if fast.id == "PandaPickAndPlace-v3":
        assert max(states[:, 9].max() for states in parts) > 0.05, "no grasp"
        assert any(step.success for episode in steps.values() for step in episode)


@pytest.mark.parametrize(
    ("name", "pair"),
    [
        ("a2c/HopperBulletEnv-v0_1", "HopperBulletEnv-v0"),
        ("ppo/HopperBulletEnv-v0_1", "HopperBulletEnv-v0"),
        ("a2c/Walker2DBulletEnv-v0_1", "Walker2DBulletEnv-v0"),
        ("ppo/HalfCheetahBulletEnv-v0_1", "HalfCheetahBulletEnv-v0"),
        ("tqc/PandaReach-v1_1", "PandaReach-v3"),
    ],
    indirect=["pair"],
)
def test_episodes_of_agents_of_the_zoo_are_equal(name, pair, shared):
    fast, plain = pair
    agent = resolve(str(shared / "agents" / name))
    policy, assembler = agent.policy(), agent.assembler()
    policy.load(agent.theta)
    for seed in (2, 0):
        side_by_side(fast, plain, seed, lambda observation, step: policy.act(assembler.features(observation, step)))


@pytest.mark.parametrize("pair", ["PandaReach-v3"], indirect=True)
def test_episodes_of_the_shipped_agent_are_equal_and_reach(pair):
    agent = resolve("panda_reach")
    policy, assembler = agent.policy(), agent.assembler()
    policy.load(agent.theta)
    for seed in (3, 1, 2):
        taken = side_by_side(*pair, seed, lambda seen, step: policy.act(assembler.features(seen, step)))
        assert taken[-1].success and len(taken) == 50


@pytest.mark.parametrize("pair", FAST, indirect=True)
def test_upstreams_own_step_may_come_between(pair):
    fast, plain = pair
    quick, count = fast._take, 0

    def mixed(action):
        nonlocal count
        count += 1
        if count % 3:
            return quick(action)
        observation, *rest = fast.unwrapped.step(action)
        return fast._cast(observation), *rest

    fast._take = mixed
    side_by_side(fast, plain, 5, scripted(plain, 5))
    assert count > 5


@pytest.mark.parametrize("take", [take_joint_targets, take_tip_targets])
@pytest.mark.parametrize("pair", ["PandaPickAndPlace-v3"], indirect=True)
def test_command_interfaces_below_the_action_are_honoured(pair, take):
    for environment in pair:
        take(environment)
    rng, state = np.random.default_rng(0), None

    def policy(observation, step):
        nonlocal state
        state = read_state(pair[0])
        rest = np.concatenate((state.tip_position, state.tip_orientation, state.positions[7:]))
        near = state.positions if take is take_joint_targets else rest
        return near + rng.normal(0, 0.02, 9)

    side_by_side(*pair, 6, policy)
    assert np.abs(state.velocities).max() > 0.1


@pytest.mark.parametrize("pair", FAST, indirect=True)
@pytest.mark.parametrize("kind", ["above the bounds", "float64"])
def test_actions_that_no_policy_gives_are_taken_as_upstream_takes_them(pair, kind):
    rng, high = np.random.default_rng(1), pair[0].spaces.high

    def policy(observation, step):
        action = 2 * rng.standard_normal(len(high))
        return action if kind == "float64" else action.astype(np.float32)

    side_by_side(*pair, 8, policy)


@pytest.mark.parametrize("pair", LOCOMOTION, indirect=True)
def test_a_wrong_action_is_refused_as_upstream_refuses_it(pair):
    for environment in pair:
        environment.reset(0)
        count = len(environment.spaces.low)
        with pytest.raises(AssertionError):
            environment.step(np.full(count, np.nan, np.float32))
        for size in (count - 1, count + 1):
            with pytest.raises((IndexError, ValueError)):
                environment.step(np.zeros(size, np.float32))


@pytest.mark.parametrize("pair", PANDA, indirect=True)
def test_an_action_of_another_size_is_refused_and_one_of_nan_is_taken_as_upstream_takes_it(pair):
    count, ends = len(pair[0].spaces.low), []
    for environment in pair:
        environment.reset(0)
        with pytest.raises(ValueError):
            environment.step(np.zeros(count + 1, np.float32))
        observation = environment.step(np.full(count, np.nan, np.float32)).observation
        ends.append([value.tobytes() for value in observation.values()])
    assert ends[0] == ends[1]


@pytest.mark.parametrize("pair", ["HopperBulletEnv-v0", "AntBulletEnv-v0"], indirect=True)
def test_a_state_that_is_not_finite_ends_the_episode_as_upstream_ends_it(pair, capsys):
    ended = []
    for environment in pair:
        environment.reset(0)
        environment.step(environment.spaces.high)
        robot = environment.unwrapped.robot
        robot.robot_body.reset_pose([0, 0, np.nan], [0, 0, 0, 1])
        taken = environment.step(environment.spaces.high)
        assert not np.isfinite(taken.observation).all() and taken.terminated
        assert not environment.unwrapped.scene.multiplayer
        ended.append((taken.observation, taken.reward))
    np.testing.assert_equal(ended[0], ended[1])
    assert capsys.readouterr().out.count("~INF~") == 2


def calls_of(environment, monkeypatch):
    """Calls of PyBullet's functions in one step."""
    pybullet, calls = pytest.importorskip("pybullet"), Counter()

    def counted(name, real):
        def call(*given, **named):
            calls[name] += 1
            return real(*given, **named)

        return call

    environment.reset(0)
    with monkeypatch.context() as patch:
        for name in dir(pybullet):
            if callable(getattr(pybullet, name)):
                patch.setattr(pybullet, name, counted(name, getattr(pybullet, name)))
        environment.step(environment.spaces.high)
    return calls


@pytest.mark.parametrize("name", FAST)
def test_a_step_makes_few_calls_of_pybullet(name, monkeypatch):
    with closing(Environment(name)) as environment:
        calls = calls_of(environment, monkeypatch)
    assert calls.pop("stepSimulation") == (20 if name in PANDA else 1)
    assert 3 < sum(calls.values()) < 10, calls


@pytest.fixture
def another_pybullet(monkeypatch):
    version = proved.metadata.version
    monkeypatch.setattr(
        proved.metadata, "version", lambda package: "3.2.6" if package == "pybullet" else version(package)
    )
    proved._is_proved.cache_clear()
    yield
    proved._is_proved.cache_clear()


def test_with_another_version_the_plain_environment_runs_and_one_sentence_says_so(another_pybullet, caplog):
    with caplog.at_level(logging.WARNING, "drs"):
        for name in ("HopperBulletEnv-v0", "HopperBulletEnv-v0", "AntBulletEnv-v0"):
            with closing(Environment(name)) as environment:
                assert not environment.is_fast
                observation = environment.reset(0)
                assert facts(environment.step(environment.spaces.high).observation) != facts(observation)
    (record,) = caplog.records
    assert record.levelname == "WARNING" and "pybullet 3.2.6 (proved: 3.2.7)" in record.getMessage()
    assert "panda" not in record.getMessage()


def test_switched_off_or_elsewhere_nothing_is_said(another_pybullet, caplog):
    for name, fast in (("PandaReach-v3", False), ("MountainCarContinuous-v0", True), ("PandaReachDense-v3", True)):
        with closing(Environment(name, fast)) as environment:
            assert not environment.is_fast
    assert not caplog.records
