"""The helper's episodes are the plain environment's, bit for bit, for the same actions."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drs_core.accelerator.compiled import CompiledRunner
from drs_core.accelerator.robot import RULES
from drs_core.accelerator.self_check import compare
from drs_core.environments import Environment
from drs_core.importing import resolve
from tests.conftest import make_agent

pytestmark = pytest.mark.usefixtures("built")
REAL = ("a2c/HopperBulletEnv-v0_1", "ppo/HopperBulletEnv-v0_1", "ppo/HalfCheetahBulletEnv-v0_1",
        "a2c/Walker2DBulletEnv-v0_1")  # fmt: skip


class Pair:
    """The plain environment, and the helper in a world of its own."""

    def __init__(self, agent):
        self.agent, self.plain = agent, Environment(agent.environment)
        self.world = Environment(agent.environment)
        self.compiled = CompiledRunner(agent, self.world)

    def close(self):
        self.plain.close()
        self.world.close()


@pytest.fixture
def pair():
    pairs = []

    def make(agent):
        pairs.append(Pair(agent))
        return pairs[-1]

    yield make
    for made in pairs:
        made.close()


@pytest.mark.parametrize("environment", RULES)
def test_wild_actions_falls_included(environment, pair):
    two, endings = pair(make_agent(environment)), []
    low, high = two.agent.low, two.agent.high
    for seed in (3, 0, 12, 3, 2**40):
        rng = np.random.default_rng(seed)
        # bang-bang at changing rates: hard contacts, joints at their limits, robots upside down
        actions = np.repeat(rng.uniform(1.5 * low, 1.5 * high, (50, len(low))), rng.integers(1, 9, 50), axis=0)
        trace = two.compiled.replay(seed, actions.astype(np.float32))
        compare(trace, seed, two.plain)
        endings.append(trace.terminated)
    assert any(endings) == RULES[environment].falls


def played(environment, seed, act):
    """Actions (n, n_actions) of act(observation, step) in the plain environment, and whether it ended the episode."""
    observation, actions, done = environment.reset(seed), [], False
    while not done:
        actions.append(act(observation, len(actions)))
        observation, _, terminated, truncated, _ = environment.step(actions[-1])
        done = terminated or truncated
    return np.array(actions), terminated


@pytest.mark.parametrize("environment", RULES)
def test_whole_episodes_of_a_robot_that_stands(environment, pair):
    """No agent for the ant is at hand; with its joints pulled to the middle of their ranges it stands."""
    two, longest = pair(make_agent(environment)), 0
    joints = slice(8, 8 + 2 * len(two.agent.low), 2)
    for seed in (1, 2):
        noise = np.random.default_rng(seed).normal(0.0, 0.1, (1000, len(two.agent.low)))

        def pull(seen, step, noise=noise):
            return np.clip(noise[step] - 0.3 * seen[joints], -1, 1).astype(np.float32)

        actions, terminated = played(two.plain, seed, pull)
        trace = two.compiled.replay(seed, actions)
        compare(trace, seed, two.plain)
        assert (len(trace.rewards), trace.terminated) == (len(actions), terminated)
        longest = max(longest, len(actions))
    assert longest == 1000 or environment in ("HopperBulletEnv-v0", "Walker2DBulletEnv-v0")


@pytest.mark.parametrize("name", REAL)
def test_whole_episodes_of_real_agents(shared, name, pair):
    two = pair(resolve(str(shared / "agents" / name)))
    policy, pipeline, lengths = two.agent.policy(), two.agent.assembler(), []
    for seed in (0, 1, 2, 3):
        actions, terminated = played(two.plain, seed, lambda seen, step: policy.act(pipeline.features(seen, step)))
        trace = two.compiled.replay(seed, actions)
        assert (len(trace.actions), trace.terminated) == (len(actions), terminated)
        compare(trace, seed, two.plain)
        lengths.append(len(actions))
    assert max(lengths) == 1000


@pytest.mark.parametrize("name", REAL)
def test_the_policy_sees_the_same_and_acts_the_same_within_1e_6(shared, name, pair):
    two = pair(resolve(str(shared / "agents" / name)))
    policy, pipeline = two.agent.policy(), two.agent.assembler()
    for seed in (5, 6):
        trace = two.compiled.rollout(seed)
        compare(trace, seed, two.plain)
        for step, (features, action) in enumerate(zip(trace.features, trace.actions, strict=True)):
            assert features.tobytes() == pipeline.features(trace.observations[step], step).tobytes()
            assert np.abs(policy.act(features) - action).max() < 1e-6


_PROGRAM = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from drs_core.accelerator import choose
from tests.conftest import make_agent
print(choose("compiled", make_agent("HopperBulletEnv-v0")))
"""


@pytest.mark.parametrize(("kernel", "feature"), [("Prescott", "sse2"), ("Haswell", "avx2"), ("SkylakeX", "avx512f")])
def test_numpy_may_round_as_it_does_on_another_processor(kernel, feature):
    """Its norm, and so the reward, depends on the BLAS kernel; the helper rounds as the numpy beside it."""
    if feature not in Path("/proc/cpuinfo").read_text():
        pytest.skip(f"this processor has no {feature}")
    result = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        env={**os.environ, "OPENBLAS_CORETYPE": kernel}, capture_output=True, text=True,
    )  # fmt: skip
    assert result.stdout.splitlines()[-1] == "compiled", result.stderr


class Turned(Environment):
    """An ant that begins pitched by `angle`, where angles of the torso are not defined by themselves."""

    angle = 0.0

    def reset(self, seed):
        super().reset(seed)
        upstream, robot = self.unwrapped, self.unwrapped.robot
        height = robot.initial_z
        position, _ = upstream._p.getBasePositionAndOrientation(robot.objects[0])
        turn = (0.0, math.sin(self.angle / 2), 0.0, math.cos(self.angle / 2))
        upstream._p.resetBasePositionAndOrientation(robot.objects[0], position, turn)
        observation = robot.calc_state()
        assert robot.initial_z == height
        upstream.potential = robot.calc_potential()
        return np.asarray(observation, dtype=np.float32)


@pytest.mark.parametrize("angle", [math.pi / 2, -math.pi / 2, 1.57, -1.57, 3.0])
def test_a_torso_that_stands_on_end(angle):
    agent, environment = make_agent("AntBulletEnv-v0"), Turned("AntBulletEnv-v0")
    environment.angle = angle
    runner = CompiledRunner(agent, environment)
    trace = runner.replay(4, np.zeros((60, 8), dtype=np.float32))
    compare(trace, 4, environment)
    environment.close()
