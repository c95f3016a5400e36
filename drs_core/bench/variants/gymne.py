"""EvoTorch's GymNE: its own evaluation of a solution, with the same network and environment."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import torch
from evotorch.neuroevolution import GymNE

from drs_core.agent import Agent
from drs_core.bench.sample import Sample, play_until
from drs_core.bench.variants.authors import activation
from drs_core.bench.variants.upstream import Repeat, for_agent, statistics

logging.getLogger("evotorch").setLevel(logging.WARNING)


class Frozen(torch.nn.Module):  # type: ignore[misc, unused-ignore]
    """The agent's frozen normaliser as a layer without parameters."""

    def __init__(self, agent: Agent) -> None:
        super().__init__()
        mean, variance = statistics(agent.pipeline)
        self._clip = agent.pipeline.clip
        self.register_buffer("mean", torch.tensor(mean, dtype=torch.float32))
        self.register_buffer(
            "scale", torch.tensor(1.0 / np.sqrt(variance + agent.pipeline.epsilon), dtype=torch.float32)
        )

    def forward(self, observation: Any) -> Any:
        """Normalised and clipped."""
        return ((observation - self.mean) * self.scale).clamp(-self._clip, self._clip)


class Bounded(torch.nn.Module):  # type: ignore[misc, unused-ignore]
    """[-1, 1] scaled to the action bounds."""

    def __init__(self, agent: Agent) -> None:
        super().__init__()
        self.register_buffer("low", torch.tensor(agent.low))
        self.register_buffer("half_range", torch.tensor(0.5 * (agent.high - agent.low)))

    def forward(self, action: Any) -> Any:
        """Scaled."""
        return self.low + (action + 1.0) * self.half_range


class GymNe:
    """``problem.evaluate`` of a batch of one solution, in this process."""

    def __init__(self, agent: Agent) -> None:
        """Make the problem and the solution with the agent's weights."""
        torch.set_num_threads(1)
        # GymNE makes one to read the spaces, and later another one that steps
        self._environments: list[tuple[Any, Repeat]] = []
        self._seed = 0
        self._problem = GymNE(
            lambda: self._environment(agent), network(agent), num_actors=0, observation_normalization=False
        )
        self._batch = self._problem.generate_batch(1)
        self._batch.set_values(torch.tensor(agent.theta)[None])

    def _environment(self, agent: Agent) -> Any:
        env, repeat = for_agent(agent, flat=True)
        repeat.seed = self._seed
        self._environments.append((env, repeat))
        return env

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again."""
        self._seed = seed
        for _, repeat in self._environments:
            repeat.seed = seed
        return play_until(steps, self._play)

    def _play(self) -> int:
        before = self._problem.interaction_count
        self._batch.forget_evals()
        self._problem.evaluate(self._batch)
        return int(self._problem.interaction_count - before)

    def close(self) -> None:
        """Free the simulators."""
        for env, _ in self._environments:
            env.close()


def network(agent: Agent) -> Any:
    """The agent's network in PyTorch, weights aside: its parameters in order are theta's."""
    layers: list[Any] = [Frozen(agent)]
    for outputs, inputs in agent.network.shapes:
        layers += [torch.nn.Linear(inputs, outputs), activation(agent.network)()]
    layers.pop()
    if agent.network.output == "tanh":
        if agent.network.mean_clip is not None:
            layers.append(torch.nn.Hardtanh(-agent.network.mean_clip, agent.network.mean_clip))
        layers += [torch.nn.Tanh(), Bounded(agent)]
    return torch.nn.Sequential(*layers)
