"""Same seed and actions, same episode, bit for bit, whatever ran before; and the same as upstream's."""

import hashlib
import importlib
from pathlib import Path

import numpy as np
import pytest

from drs_core.environments import PAPER, Environment
from drs_core.environments.catalogue import entry

STEPS = 120


def toward_the_object(observation, rng, low, high):
    """Random actions; with an object, such as push it about, so that contacts leave their traces."""
    action = rng.uniform(low, high)
    if isinstance(observation, dict) and len(observation["observation"]) > 6:
        state = observation["observation"]
        thing = state[7:10] if len(low) == 4 else state[6:9]
        action[:3] = np.clip(8 * (thing - state[:3]) + rng.normal(0, 0.3, 3), -1, 1)
    return action.astype(np.float32)


def play(reset, step, low, high, seed):
    digest, rng = hashlib.sha256(), np.random.default_rng(seed)
    observation = reset(seed)
    for _ in range(STEPS):
        values = [observation[key] for key in sorted(observation)] if isinstance(observation, dict) else [observation]
        for value in values:
            digest.update(np.asarray(value, dtype=np.float32).tobytes())
        observation, reward, ended = step(toward_the_object(observation, rng, low, high))
        digest.update(np.float64(reward).tobytes())
        if ended:
            break
    return digest.hexdigest()


def ours(environment, seed):
    def step(action):
        taken = environment.step(action)
        return taken.observation, taken.reward, taken.terminated or taken.truncated

    return play(environment.reset, step, environment.spaces.low, environment.spaces.high, seed)


@pytest.mark.parametrize("name", PAPER)
def test_an_episode_does_not_depend_on_what_ran_before(name):
    reused, fresh = Environment(name), Environment(name)
    for seed in (11, 5, 3):
        ours(reused, seed)
    assert ours(reused, 7) == ours(fresh, 7)
    assert ours(reused, 3) == ours(fresh, 3)
    reused.close()
    fresh.close()


def test_how_the_arm_moved_before_does_not_matter_where_two_fingers_press_on_the_table():
    # two episodes of a search; from the first Bullet remembered an order of pairs of bodies
    known = np.load(Path(__file__).with_name("pressing.npz"))

    def seen(environment, part):
        environment.reset(int(known[f"{part}_seed"]))
        return np.array([environment.step(action).observation["observation"] for action in known[part]])

    reused, fresh = Environment("PandaReach-v3"), Environment("PandaReach-v3")
    seen(reused, "before")
    alone = seen(fresh, "pressing")
    assert alone[:, 2].min() < 0.01
    np.testing.assert_array_equal(seen(reused, "pressing"), alone)
    reused.close()
    fresh.close()


@pytest.mark.parametrize("name", PAPER)
def test_an_episode_is_upstreams(name):
    gymnasium = pytest.importorskip("gymnasium")
    package = entry(name).package
    if package:
        importlib.import_module(package)
    upstream = gymnasium.make(name, disable_env_checker=True)
    panda = name.startswith("Panda")

    def reset(seed):
        return upstream.reset(seed=seed)[0]

    def step(action):
        # panda-gym 3 says terminated at every step at the goal, and goes on all the same
        observation, reward, terminated, truncated, _ = upstream.step(action)
        return observation, reward, truncated or (terminated and not panda)

    if entry(name).family == "locomotion":
        reset(0)
    if name.startswith("PandaReach"):
        # upstream's order of contacts depends on earlier episodes
        upstream.unwrapped.sim.physics_client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
    environment = Environment(name)
    low, high = environment.spaces.low, environment.spaces.high
    assert ours(environment, 3) == play(reset, step, low, high, 3)
    environment.close()
    upstream.close()


def test_panda_runs_its_50_steps_and_keeps_success():
    environment = Environment("PandaReach-v1")
    assert environment.id == "PandaReach-v3"
    observation, taken, successes = environment.reset(1), None, 0
    for step in range(50):
        error = observation["desired_goal"] - observation["achieved_goal"]
        taken = environment.step(np.clip(error * 10, -1, 1).astype(np.float32))
        observation, successes = taken.observation, successes + bool(taken.success)
        assert not taken.terminated and taken.truncated == (step == 49)
    assert taken.success is True and successes > 30
    environment.close()
