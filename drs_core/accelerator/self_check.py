"""Proof at start-up that the helper and the plain environment give the same episode, bit for bit."""

from __future__ import annotations

import numpy as np

from drs_core.accelerator.compiled import CompiledRunner, Trace
from drs_core.accelerator.library import Unavailable
from drs_core.agent import Agent
from drs_core.environments import Environment

STEPS = 100
_MEND = "report it with the versions of pybullet, numpy and the C library"
_SEED = 1
_TOLERANCE = 1e-5
"""Of an action: the helper's network adds up in another order than numpy's, both in float64."""


def check(runner: CompiledRunner, agent: Agent, environment: Environment) -> None:
    """Compare two short episodes: the agent's own, and one of wild actions, in which it falls.

    Raises:
        Unavailable: they differ from the plain environment's, or the policy from the plain one.
    """
    own = runner.rollout(_SEED, STEPS)
    pipeline, policy = agent.assembler(), agent.policy()
    tolerance = _TOLERANCE * float(np.max(agent.high - agent.low))
    for step, (features, action) in enumerate(zip(own.features, own.actions, strict=True)):
        if features.tobytes() != pipeline.features(own.observations[step], step).tobytes():
            raise Unavailable(f"its features of step {step} are not those of the plain path; {_MEND}")
        if not np.allclose(action, policy.act(features), rtol=0.0, atol=tolerance):
            raise Unavailable(f"its action of step {step} is not that of the plain path; {_MEND}")
    compare(own, _SEED, environment)
    wild = np.random.default_rng(_SEED).uniform(agent.low, agent.high, (STEPS, len(agent.low)))
    compare(runner.replay(_SEED + 1, wild.astype(np.float32)), _SEED + 1, environment)


def compare(trace: Trace, seed: int, environment: Environment) -> None:
    """Repeat a trace's actions in the plain environment.

    Raises:
        Unavailable: an observation, a reward or the ending is not the trace's, bit for bit.
    """
    observation = environment.reset(seed)
    _same("observation", 0, observation, trace.observations[0])
    last = len(trace.actions) - 1
    for step, action in enumerate(trace.actions):
        observation, reward, terminated, _, _ = environment.step(action)
        _same("observation", step + 1, observation, trace.observations[step + 1])
        _same("reward", step, np.float64(reward), trace.rewards[step])
        _same("ending", step, np.bool_(terminated), np.bool_(trace.terminated and step == last))


def _same(what: str, step: int, plain: object, compiled: object) -> None:
    if np.asarray(plain).tobytes() != np.asarray(compiled).tobytes():
        raise Unavailable(f"its {what} of step {step} is not that of the plain environment; {_MEND}")
