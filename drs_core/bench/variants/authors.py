"""The style of the paper's authors: a model of Stable-Baselines3 that predicts, step by step, in a vector of one."""

from __future__ import annotations

from typing import Any

import sb3_contrib
import stable_baselines3
import torch

from drs_core.agent import Agent
from drs_core.bench.sample import Sample, play_until
from drs_core.bench.variants.vec_env import vec_env
from drs_core.policy import Network

_MODULES = {
    "relu": torch.nn.ReLU,
    "tanh": torch.nn.Tanh,
    "elu": torch.nn.ELU,
    "leaky_relu": torch.nn.LeakyReLU,
    "silu": torch.nn.SiLU,
}


def activation(network: Network) -> Any:
    """PyTorch's module of the network's activation."""
    return _MODULES[network.activation]


class Authors:
    """``model.predict(observation, deterministic=True)``, then ``env.step``, until done."""

    def __init__(self, agent: Agent) -> None:
        """Make the environment, and a model with the agent's weights."""
        torch.set_num_threads(1)
        self._env, self._repeat = vec_env(agent)
        self.model = model(agent, self._env)

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again."""
        self._repeat.seed = seed
        return play_until(steps, self._play)

    def _play(self) -> int:
        env, predict, length = self._env, self.model.predict, 0
        observation, done = env.reset(), False
        while not done:
            action, _ = predict(observation, deterministic=True)
            observation, _, dones, _ = env.step(action)
            done = dones[0]
            length += 1
        return length

    def close(self) -> None:
        """Free the simulator."""
        self._env.close()


def model(agent: Agent, env: Any) -> Any:
    """A Stable-Baselines3 model that acts as the agent does: the inverse of importing one."""
    network = agent.network
    squashed = network.output == "tanh"
    algorithm = str(agent.source.get("algorithm", ""))
    kind = algorithm if algorithm in ("a2c", "ppo", "ddpg", "td3", "sac", "tqc") else ("tqc" if squashed else "a2c")
    if squashed == (kind in ("a2c", "ppo")):
        kind = "tqc" if squashed else "a2c"
    settings: dict[str, Any] = {} if kind in ("a2c", "ppo") else {"buffer_size": 1}
    if network.mean_clip is not None:
        settings["use_sde"] = True
    classes = {**vars(stable_baselines3), "TQC": sb3_contrib.TQC}
    made = classes[kind.upper()](
        "MultiInputPolicy" if agent.pipeline.is_dict else "MlpPolicy",
        env,
        policy_kwargs={"net_arch": list(network.sizes[1:-1]), "activation_fn": activation(network)},
        device="cpu",
        **settings,
    )
    state = made.policy.state_dict()
    for name, (weight, bias) in zip(_layer_names(kind, len(network.shapes), state), network.layers(agent.theta)):
        state[f"{name}.weight"], state[f"{name}.bias"] = torch.tensor(weight), torch.tensor(bias)
    made.policy.load_state_dict(state)
    made.policy.set_training_mode(False)
    return made


def _layer_names(kind: str, layers: int, state: Any) -> list[str]:
    hidden = range(0, 2 * (layers - 1), 2)
    if kind in ("a2c", "ppo"):
        return [*(f"mlp_extractor.policy_net.{index}" for index in hidden), "action_net"]
    if kind in ("ddpg", "td3"):
        return [f"actor.mu.{index}" for index in range(0, 2 * layers, 2)]
    last = "actor.mu.0" if "actor.mu.0.weight" in state else "actor.mu"
    return [*(f"actor.latent_pi.{index}" for index in hidden), last]
