"""Valid files of every kind that is read from elsewhere, small, and made without PyTorch or Stable-Baselines3."""

from __future__ import annotations

import collections
import io
import json
import pickle
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from drs_core.agent import Agent
from drs_core.run_folder import RunFolder
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from tests.conftest import make_agent
from tests.fuzz.mutate import zipped
from tests.recording.conftest import actions_of, write
from tests.test_tuning import tune

ENVIRONMENT = "MountainCarContinuous-v0"
HERE = __name__.encode()
ZOO = {
    "config.yml": """!!python/object/apply:collections.OrderedDict
- - - normalize
    - true
  - - n_timesteps
    - 100000.0
  - - policy
    - MlpPolicy
""",
    "args.yml": """!!python/object/apply:collections.OrderedDict
- - - algo
    - a2c
  - - env
    - MountainCarContinuous-v0
  - - env_kwargs
    - null
  - - seed
    - 0
""",
    "env_kwargs.yml": "{}\n",
}
PARAMETERS = """/**:
  ros__parameters:
    agent: panda_reach
    autostart: false
    objective: smooth
    smoothness_weight: 0.5
    updates: 20
    alpha: [0.02, 0.01]
    sigma: [0.025, 0.0125]
tuner_node:
  ros__parameters: {seed: 7, evaluate_every: 0, backend: python, output: "runs/x"}
policy_node:
  ros__parameters: {input: arm, workspace_min_m: [0.25, -0.4, 0.02]}
"""


class FloatStorage:
    """Stands for PyTorch's."""


class VecNormalize:
    """Stands for Stable-Baselines3's."""


class RunningMeanStd:
    """Likewise."""


def _rebuild_tensor_v2(*arguments: Any) -> None:
    """Stands for PyTorch's, and is never called."""


class _Tensor:
    def __init__(self, key: str, shape: tuple[int, ...]) -> None:
        self.key, self.shape = key, shape

    def __reduce__(self) -> tuple[Any, ...]:
        steps = tuple(int(np.prod(self.shape[i + 1 :])) for i in range(len(self.shape)))
        return _rebuild_tensor_v2, (_Stored(self), 0, self.shape, steps, False, collections.OrderedDict())


class _Stored:
    def __init__(self, tensor: _Tensor) -> None:
        self.tensor = tensor


class _Pickler(pickle.Pickler):
    def persistent_id(self, value: Any) -> Any:
        if isinstance(value, _Stored):
            return "storage", FloatStorage, value.tensor.key, "cpu", int(np.prod(value.tensor.shape))
        return None


def weights(seed: int = 0) -> bytes:
    """policy.pth of an A2C policy for MountainCarContinuous."""
    shapes = {
        "log_std": (1,),
        "mlp_extractor.policy_net.0.weight": (8, 2),
        "mlp_extractor.policy_net.0.bias": (8,),
        "action_net.weight": (1, 8),
        "action_net.bias": (1,),
    }
    rng, buffer, members = np.random.default_rng(seed), io.BytesIO(), []
    state = collections.OrderedDict()
    for key, (name, shape) in enumerate(shapes.items()):
        state[name] = _Tensor(str(key), shape)
        members.append((f"archive/data/{key}", rng.normal(size=shape).astype("<f4").tobytes()))
    _Pickler(buffer, protocol=2).dump(state)
    index = buffer.getvalue()
    index = index.replace(b"c" + HERE + b"\n_rebuild", b"ctorch._utils\n_rebuild").replace(b"c" + HERE, b"ctorch")
    return zipped([("archive/data.pkl", index), ("archive/byteorder", b"little"), *members])


def sb3_zip() -> bytes:
    """A saved model of Stable-Baselines3."""
    data = {
        "policy_class": {":type:": "<class 'abc.ABCMeta'>", "__module__": "stable_baselines3.common.policies"},
        "policy_kwargs": {":type:": "<class 'dict'>", "activation_fn": "<class 'torch.nn.modules.activation.Tanh'>"},
        "action_space": {":type:": "<class 'gymnasium.spaces.box.Box'>", ":serialized:": "gAWV", "_shape": [1]},
        "use_sde": False,
        "max_grad_norm": 0.5,
    }
    members = [("data", json.dumps(data).encode()), ("policy.pth", weights())]
    return zipped([*members, ("_stable_baselines3_version", b"2.3.0")])


def normaliser() -> bytes:
    """A saved VecNormalize for MountainCarContinuous."""
    statistics, saved = RunningMeanStd(), VecNormalize()
    statistics.__dict__ |= {"mean": np.array([0.1, -0.2]), "var": np.array([1.5, 0.5]), "count": 100.0}
    saved.__dict__ |= {
        "obs_rms": statistics,
        "clip_obs": 10.0,
        "epsilon": np.float64(1e-8),
        "norm_obs": True,
        "norm_obs_keys": None,
        "ret": np.zeros(1),
    }
    content = pickle.dumps(saved, protocol=2)
    package = b"cstable_baselines3.common."
    content = content.replace(b"c" + HERE + b"\nVec", package + b"vec_env.vec_normalize\nVec")
    return content.replace(b"c" + HERE + b"\nRun", package + b"running_mean_std\nRun")


def zoo(folder: Path) -> Path:
    """A folder of the zoo."""
    inner = folder / ENVIRONMENT
    inner.mkdir(parents=True)
    inner.with_suffix(".zip").write_bytes(sb3_zip())
    for name, text in ZOO.items():
        (inner / name).write_text(text)
    (inner / "vecnormalize.pkl").write_bytes(normaliser())
    return folder


def tuned_agent() -> Agent:
    """With a tuning record and a source."""
    record = {"updates_done": 2, "seed": 0, "objective": "return", "alpha": [0.3, 0.1], "objective_mean": -3.5}
    agent = make_agent(ENVIRONMENT)
    return agent.with_theta(agent.theta, (record,))


def recording(path: Path, count: int = 12) -> Path:
    """Observations of MountainCarContinuous and what an agent answered."""
    agent = make_agent(ENVIRONMENT)
    return write(path, agent, actions_of(agent, count))


def run(folder: Path) -> TuneConfig:
    """A run of two updates, every file of a run included."""
    config = TuneConfig(
        SearchConfig(updates=3, directions=1, alpha=(0.3, 0.1), sigma=(0.3, 0.1), seed=5),
        evaluate_every=1,
        evaluation_episodes=1,
    )
    tune(make_agent(ENVIRONMENT), folder, stop_after=2, config=config)
    RunFolder(folder).goes_on_with({"numpy": "1.26.0"}, 2)
    return config


def rng_of(seed: int, index: int) -> Random:
    """The random numbers of one input, which anybody can draw again."""
    return Random(f"{seed}:{index}")
