"""The real agents of the zoo act as Stable-Baselines3 says they do."""

from dataclasses import replace

import numpy as np
import pytest

from drs_core.importing import resolve

AGENTS = [
    "a2c/HopperBulletEnv-v0",
    "a2c/LunarLanderContinuous-v2",
    "a2c/MountainCarContinuous-v0",
    "a2c/Walker2DBulletEnv-v0",
    "ddpg/LunarLanderContinuous-v2",
    "ddpg/MountainCarContinuous-v0",
    "ppo/BipedalWalker-v3",
    "ppo/HalfCheetahBulletEnv-v0",
    "ppo/HopperBulletEnv-v0",
    "ppo/MountainCarContinuous-v0",
    "sac/MountainCarContinuous-v0",
    "tqc/MountainCarContinuous-v0",
    "tqc/PandaReach-v1",
]


@pytest.mark.parametrize("name", AGENTS)
def test_actions_equal_those_of_stable_baselines(shared, name):
    golden = np.load(shared / "golden" / "deterministic_actions.npz")
    agent = resolve(str(shared / "agents" / f"{name}_1"))
    policy = agent.policy()
    # the golden observations carry the time feature already
    assembler = replace(agent, pipeline=replace(agent.pipeline, time_limit_steps=None)).assembler()
    key = f"{name}/raw_observation"
    parts = {k.removeprefix(key + "/"): golden[k] for k in golden.files if k.startswith(key + "/")}
    for index, expected in enumerate(golden[f"{name}/action"]):
        raw = {part: values[index] for part, values in parts.items()} if parts else golden[key][index]
        assert np.abs(policy.act(assembler.features(raw, 0)) - expected).max() < 1e-5
