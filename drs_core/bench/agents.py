"""Whose policy acts in a benchmark: an agent of the zoo, a shipped one, or random weights of the zoo's size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drs_core.agent import Agent, load
from drs_core.agents import shipped
from drs_core.environments import current_name, describe
from drs_core.importing import resolve
from drs_core.observation import MAIN, Part, Pipeline
from drs_core.policy import Network

_SEED = 2
"""Of random weights: the first with which Ant stays up for its 1000 steps."""
_STAND_IN = {"BipedalWalkerHardcore-v3": "BipedalWalker-v3"}
"""Where the zoo's agent of another environment sees and does the same."""


@dataclass(frozen=True)
class Size:
    """Of the zoo's network: units of the hidden layers, activation, and how actions are bounded.

    `last_layer` scales the last layer's random weights. It is small for A2C and PPO, as
    Stable-Baselines3 initialises them: a body that does not thrash falls later. Ant would lie down at once.
    """

    hidden: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    output: str = "clip"
    last_layer: float = 0.01


def size_of(environment_id: str) -> Size:
    """A2C and PPO have 64 x 64 tanh; TQC of the reaching arm 64 x 64, of the other arms 256 x 256 ReLU."""
    if environment_id.startswith("Ant"):
        return Size(last_layer=1.0)
    if not environment_id.startswith("Panda"):
        return Size()
    return Size((64, 64) if "Reach" in environment_id else (256, 256), "relu", "tanh", last_layer=1.0)


def bench_agent(environment_id: str, zoo: Path | None) -> Agent:
    """The agent that all variants run in an environment."""
    return _zoo_agent(environment_id, zoo) or _shipped_agent(environment_id) or random_agent(environment_id)


def random_agent(environment_id: str, size: Size | None = None) -> Agent:
    """Fixed random weights behind the zoo's observation pipeline (time feature for robots, normaliser)."""
    size, spaces = size or size_of(environment_id), describe(environment_id)
    timed = "Bullet" in environment_id or environment_id.startswith("Panda")
    sizes = {key: n + (timed and key == MAIN) for key, n in spaces.parts.items()}
    pipeline = Pipeline(
        parts=tuple(Part(key, n, np.zeros(n), np.ones(n)) for key, n in sizes.items()),
        is_dict=spaces.is_dict,
        time_limit_steps=spaces.time_limit_steps if timed else None,
    )
    network = Network((pipeline.size, *size.hidden, len(spaces.low)), size.activation, size.output)
    rng = np.random.default_rng(_SEED)
    theta = np.zeros(network.parameters)
    for weight, _ in network.layers(theta):
        weight[:] = rng.standard_normal(weight.shape) / np.sqrt(weight.shape[1])
    network.layers(theta)[-1][0][:] *= size.last_layer
    algorithm = "a2c" if size.output == "clip" else "tqc"
    return Agent(
        environment_id,
        pipeline,
        network,
        spaces.low,
        spaces.high,
        theta.astype(np.float32),
        source={"algorithm": algorithm, "weights": "random"},
    )


def description(agent: Agent) -> str:
    """For people: ``a2c 16-64-64-3 tanh`` and whether its weights are random."""
    layers = "-".join(map(str, agent.network.sizes))
    random = ", random weights" if agent.source.get("weights") == "random" else ""
    return f"{agent.source.get('algorithm', 'unknown')} {layers} {agent.network.activation}{random}"


def _zoo_agent(environment_id: str, zoo: Path | None) -> Agent | None:
    if zoo is None:
        return None
    wanted = (environment_id, _STAND_IN.get(environment_id))
    for name in filter(None, wanted):
        for path in sorted(zoo.glob("*/*_1")):
            if current_name(path.name.rpartition("_")[0]) == name:
                return replace(resolve(str(path)), environment=environment_id)
    return None


def _shipped_agent(environment_id: str) -> Agent | None:
    found = (load(path) for path in shipped().values())
    return next((agent for agent in found if agent.environment == environment_id), None)
