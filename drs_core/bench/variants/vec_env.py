"""Stable-Baselines3's stack around an environment: Monitor, DummyVecEnv, VecNormalize with frozen statistics."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from drs_core.agent import Agent
from drs_core.bench.variants.upstream import Repeat, for_agent, statistics


def vec_env(agent: Agent, flat: bool = False) -> tuple[Any, Repeat]:
    """The stack, without VecNormalize for an agent without; the second one chooses the seed."""
    env, repeat = for_agent(agent, flat)
    venv: Any = DummyVecEnv([lambda: Monitor(env)])
    pipeline = agent.pipeline
    normalised = [part.key for part in pipeline.parts if part.mean is not None]
    if not normalised:
        return venv, repeat
    as_dict = pipeline.is_dict and not flat
    venv = VecNormalize(
        venv,
        training=False,
        norm_reward=False,
        clip_obs=pipeline.clip,
        epsilon=pipeline.epsilon,
        norm_obs_keys=normalised if as_dict else None,
    )
    if as_dict:
        for part in pipeline.parts:
            if part.mean is not None:
                venv.obs_rms[part.key] = _running(part.mean, part.variance)
    else:
        venv.obs_rms = _running(*statistics(pipeline))
    return venv, repeat


def _running(mean: Any, variance: Any) -> Any:
    running = RunningMeanStd(shape=mean.shape)
    running.mean, running.var = mean, variance
    return running
