"""Zips made by the installed Stable-Baselines3 act the same after import, for all six algorithms."""

import numpy as np
import pytest

from drs_core.importing import Hints, import_agent

sb3 = pytest.importorskip("stable_baselines3")
contrib = pytest.importorskip("sb3_contrib")
import gymnasium  # noqa: E402
import torch  # noqa: E402
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize  # noqa: E402

STEPS = 500
CASES = [
    ("a2c", "MountainCarContinuous-v0", {"use_sde": True, "policy_kwargs": {"net_arch": [16], "log_std_init": -1}}),
    ("ppo", "LunarLanderContinuous-v3", {"n_steps": 250, "batch_size": 50, "policy_kwargs": {"activation_fn": "ReLU"}}),
    ("ddpg", "MountainCarContinuous-v0", {"policy_kwargs": {"net_arch": [24, 16]}}),
    ("td3", "PandaReach-v3", {"policy_kwargs": {"net_arch": [16, 16], "activation_fn": "ELU"}}),
    ("sac", "LunarLanderContinuous-v3", {"use_sde": True, "policy_kwargs": {"net_arch": [16], "clip_mean": 1.5}}),
    ("tqc", "PandaReach-v3", {"policy_kwargs": {"net_arch": [16, 16], "n_critics": 1}}),
]


@pytest.mark.parametrize(("algorithm", "environment", "settings"), CASES, ids=[case[0] for case in CASES])
def test_a_zip_of_today(tmp_path, algorithm, environment, settings):
    import panda_gym  # noqa: F401

    kwargs = dict(settings["policy_kwargs"])
    if "activation_fn" in kwargs:
        kwargs["activation_fn"] = getattr(torch.nn, kwargs["activation_fn"])
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make(environment)]), norm_reward=False)
    replay = {"buffer_size": 1000, "learning_starts": 400} if algorithm in ("ddpg", "td3", "sac", "tqc") else {}
    policy = "MultiInputPolicy" if environment.startswith("Panda") else "MlpPolicy"
    factory = contrib.TQC if algorithm == "tqc" else getattr(sb3, algorithm.upper())
    model = factory(policy, env, seed=1, **{**settings, **replay, "policy_kwargs": kwargs})
    model.learn(STEPS)
    model.save(tmp_path / "model.zip")
    env.save(str(tmp_path / "vecnormalize.pkl"))

    agent = import_agent(str(tmp_path / "model.zip"), Hints(environment=environment))
    assert agent.source["algorithm"] == algorithm
    assert agent.source["stable_baselines3"] == sb3.__version__
    policy_here, assembler = agent.policy(), agent.assembler()
    env.training = False
    raw = env.venv.reset()
    for _ in range(50):
        expected, _ = model.predict(env.normalize_obs(raw), deterministic=True)
        single = {key: value[0] for key, value in raw.items()} if isinstance(raw, dict) else raw[0]
        np.testing.assert_allclose(policy_here.act(assembler.features(single, 0)), expected[0], atol=1e-5)
        raw, _, _, _ = env.venv.step(np.array([env.action_space.sample()]))


def test_the_weights_are_those_that_torch_reads(shared):
    import io
    import zipfile

    from drs_core.importing.weights import read_weights

    for path in sorted(shared.glob("agents/*/*/*.zip")):
        with zipfile.ZipFile(path) as archive:
            content = archive.read("policy.pth")
        expected = torch.load(io.BytesIO(content), weights_only=True, map_location="cpu")
        found = read_weights(content, path.name)
        assert set(found) == set(expected)
        for name, tensor in expected.items():
            np.testing.assert_array_equal(found[name].array(), tensor.numpy())
