"""The plain upstream environment as peers get it, and what it takes to compare like with like.

All of this is in the peers' favour: no environment checker, one small wrapper where they need it.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from drs_core.agent import Agent
from drs_core.environments.upstream import upstream
from drs_core.observation import Pipeline


class Repeat(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Every episode from `seed`, for those who reset without one."""

    seed = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin the episode of `self.seed`."""
        return self.env.reset(seed=self.seed, options=options)


class Flat(gymnasium.ObservationWrapper[Any, Any, Any]):
    """A dict observation as one vector, parts in the order of the pipeline, for those who take no dicts."""

    def __init__(self, env: Any, pipeline: Pipeline) -> None:
        super().__init__(env)
        self._keys = [part.key for part in pipeline.parts]
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (pipeline.size,), np.float32)

    def observation(self, observation: Any) -> Any:
        """Concatenated."""
        return np.concatenate([observation[key] for key in self._keys], dtype=np.float32)


def for_agent(agent: Agent, flat: bool) -> tuple[Any, Repeat]:
    """The environment with the agent's time feature; the second one chooses the seed.

    Args:
        agent: whose policy will act.
        flat: dict observations become one vector.
    """
    env: Any = Repeat(upstream(agent.environment))
    repeat = env
    if agent.pipeline.time_limit_steps is not None:
        from sb3_contrib.common.wrappers import TimeFeatureWrapper

        env = TimeFeatureWrapper(env, max_steps=agent.pipeline.time_limit_steps)
    if flat and agent.pipeline.is_dict:
        env = Flat(env, agent.pipeline)
    return env, repeat


def statistics(pipeline: Pipeline) -> tuple[Any, Any]:
    """Mean and variance (n_features,) float64 over all parts; 0 and 1 where a part is not normalised."""
    means = [np.zeros(part.size) if part.mean is None else part.mean for part in pipeline.parts]
    variances = [np.ones(part.size) if part.variance is None else part.variance for part in pipeline.parts]
    return np.concatenate(means), np.concatenate(variances)
