"""Episodes in one call each: the world is Python's, the steps are the helper's."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.accelerator.library import NOT_FINITE_ACTION, Record, Unavailable, client_of, helper, pointer
from drs_core.accelerator.network import PolicyData
from drs_core.accelerator.robot import RULES, RobotData
from drs_core.agent import Agent
from drs_core.environments import Environment
from drs_core.episode import ACTIONS, DIMENSION, Episode, wrong_action, wrong_state
from drs_core.errors import UsageError
from drs_core.measures.mesh_dimension import measure_dimension
from drs_core.measures.smoothness import mean_action_change
from drs_core.policy import Float32


@dataclass(frozen=True)
class Trace:
    """What one rollout recorded; arrays are views that the next rollout writes over.

    Attributes:
        observations: (length + 1, n_observation) float32, from the reset to after the last step.
        features: (length, n_features) float32, what the policy saw; zeros where actions were given.
        actions: (length, n_actions) float32.
        rewards: (length,) float64.
        total: sum of the rewards, added in their order.
        terminated: the environment ended it.
    """

    observations: Float32
    features: Float32
    actions: Float32
    rewards: NDArray[np.float64]
    total: float
    terminated: bool


class CompiledRunner:
    """Runs episodes of one agent's policy, as `EpisodeRunner` does, in somebody else's environment."""

    def __init__(self, agent: Agent, environment: Environment) -> None:
        """Hand an environment over to the helper; it stays the caller's.

        Raises:
            Unavailable: the helper is missing, refused, or cannot run such an agent.
        """
        check_supported(agent)
        self._library, self._policy = helper(), PolicyData(agent)
        self._environment, self._limit = environment, environment.spaces.time_limit_steps
        environment.reset(0)
        self._robot = RobotData(environment.id, environment.unwrapped)
        if environment.spaces.parts != {"observation": self._robot.n_observation}:
            raise Unavailable(f"it observes {self._robot.n_observation} numbers, not {environment.spaces.parts}")
        self._world = environment.unwrapped._p
        self._number: int = self._world._client
        self._client = client_of(self._world)
        n_steps, self._n_actions = self._limit, self._robot.n_joints
        self._observations = np.zeros((n_steps + 1, self._robot.n_observation), dtype=np.float32)
        self._features = np.zeros((n_steps, self._policy.n_features), dtype=np.float32)
        self._actions = np.zeros((n_steps, self._n_actions), dtype=np.float32)
        self._rewards = np.zeros(n_steps)
        self._record = Record(
            observations=pointer(self._observations),
            features=pointer(self._features),
            actions=pointer(self._actions),
            rewards=pointer(self._rewards),
        )
        self.load(agent.theta)

    def load(self, theta: Float32) -> None:
        """Act with theta (d,) from now on."""
        self._policy.load(theta)

    def run(self, seed: int, measure: frozenset[str] = frozenset()) -> Episode:
        """Run the episode of this seed; of `measure` only DIMENSION and ACTIONS are defined here.

        Raises:
            DrsError: the policy gave an action, or the environment a reward or observation, that is not finite.
        """
        trace = self.rollout(seed)
        if not (np.isfinite(trace.total) and np.isfinite(trace.features).all()):
            raise wrong_state(self._environment.id, seed)
        length = len(trace.rewards)
        return Episode(
            seed=seed,
            return_=trace.total,
            length=length,
            terminated=trace.terminated,
            failed=trace.terminated and length < self._limit,
            success=None,
            action_change=mean_action_change(trace.actions),
            dimension=measure_dimension(trace.features) if DIMENSION in measure else None,
            actions=trace.actions.copy() if ACTIONS in measure else None,
        )

    def rollout(self, seed: int, most_steps: int | None = None) -> Trace:
        """The episode of this seed with the policy, of `most_steps` at most.

        Raises:
            DrsError: the policy gave an action that is not finite.
        """
        return self._call(seed, self._limit if most_steps is None else most_steps, self._policy.structure)

    def replay(self, seed: int, actions: Float32) -> Trace:
        """The episode of this seed with these actions (n, n_actions) float32, until they or it end.

        Raises:
            UsageError: they are of another shape, or more than the time limit.
            DrsError: an action is not finite.
        """
        if actions.ndim != 2 or actions.shape[1] != self._n_actions or not 1 <= len(actions) <= self._limit:
            raise UsageError(f"Actions have shape {actions.shape}; allowed are (1..{self._limit}, {self._n_actions}).")
        self._actions[: len(actions)] = actions
        return self._call(seed, len(actions), None)

    def _call(self, seed: int, most_steps: int, policy: Any) -> Trace:
        if not 1 <= most_steps <= self._limit:
            raise UsageError(f"steps are {most_steps}; allowed are 1..{self._limit}.")
        if self._environment.unwrapped._p is not self._world or self._world._client != self._number:
            # the handle would point to what was freed with the world
            raise UsageError(f"{self._environment.id} was closed; make a new runner.")
        self._environment.reset(seed)
        record = self._record
        record.capacity = most_steps
        result = self._library.drs_rollout(
            self._client, self._robot.structure, None if policy is None else ctypes.byref(policy), record
        )
        if result == NOT_FINITE_ACTION:
            raise wrong_action(self._environment.id, seed)
        if result:
            raise Unavailable(f"it stopped in {self._environment.id} with seed {seed}, result {result}: sizes differ")
        n = record.length
        return Trace(
            self._observations[: n + 1],
            self._features[:n],
            self._actions[:n],
            self._rewards[:n],
            record.total,
            bool(record.terminated),
        )


def check_supported(agent: Agent) -> None:
    """Raise Unavailable where the helper is not made for the agent's environment; nothing is simulated yet."""
    if agent.environment not in RULES:
        raise Unavailable(f"it runs {', '.join(RULES)} only, not {agent.environment}")
