"""sb3_contrib ARS: its own evaluation of candidates."""

from __future__ import annotations

import math

import torch
from sb3_contrib import ARS

from drs_core.agent import Agent
from drs_core.bench.sample import Sample, Stopwatch
from drs_core.bench.variants.authors import activation
from drs_core.bench.variants.vec_env import vec_env


class Ars:
    """``ARS.evaluate_candidates``, which is how ARS rolls out."""

    def __init__(self, agent: Agent) -> None:
        """Make the environment (ARS takes no dict observations: flat), and ARS with the agent's weights."""
        torch.set_num_threads(1)
        self._env, self._repeat = vec_env(agent, flat=True)
        policy = {
            "net_arch": list(agent.network.sizes[1:-1]),
            "activation_fn": activation(agent.network),
            "squash_output": agent.network.output == "tanh",
        }
        self._ars = ARS("MlpPolicy", self._env, n_delta=1, policy_kwargs=policy, device="cpu")
        _, self._callback = self._ars._setup_learn(1, None)
        # its vector is weight and bias, layer by layer, like theta
        self._weights = torch.tensor(agent.theta)
        self._episode_steps: dict[int, int] = {}

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again: one candidate an episode."""
        self._repeat.seed = seed
        taken = rollouts = 0
        watch = Stopwatch()
        with watch.running(), torch.no_grad():
            while taken < steps:
                count = math.ceil((steps - taken) / self._episode_steps.get(seed, steps))
                taken += self._evaluate(count)
                rollouts += count
        self._episode_steps[seed] = max(1, taken // rollouts)
        return Sample(taken, rollouts, watch.cpu_s, watch.wall_s)

    def _evaluate(self, count: int) -> int:
        before = self._ars.num_timesteps
        self._ars.pop_size = count
        self._ars.evaluate_candidates(self._weights.expand(count, -1), self._callback, None)
        return int(self._ars.num_timesteps - before)

    def close(self) -> None:
        """Free the simulator."""
        self._env.close()
