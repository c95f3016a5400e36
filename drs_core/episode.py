"""One deterministic rollout: environment, observation pipeline and maximum likelihood action, no noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent
from drs_core.environments import Environment
from drs_core.errors import DrsError, UsageError
from drs_core.measures.mesh_dimension import MeshDimension, measure_dimension
from drs_core.measures.smoothness import TipMotion, mean_action_change, tip_motion
from drs_core.observation import MAIN
from drs_core.policy import Float32

DIMENSION, MOTION, TRAJECTORY, ACTIONS = "dimension", "motion", "trajectory", "actions"
"""What a rollout gives on request: mesh dimension, tip smoothness, tip positions and velocities, actions."""
SEEN = "seen"
"""What the policy saw, step by step; only of `EpisodeRunner`."""


@dataclass(frozen=True)
class Episode:
    """What one rollout gave.

    Attributes:
        seed: of the episode.
        return_: sum of rewards.
        length: steps.
        terminated: the environment ended it (not the time limit).
        failed: it was ended before its time limit without success.
        success: at its last step; None where the environment does not define it.
        action_change: mean |a_t - a_(t-1)| over steps and actions.
        dimension: mesh dimension of what the policy saw, if measured.
        motion: smoothness of the tip, if measured (Panda).
        tip_position, tip_velocity: (length, 3) float32 in m and m/s after every step, if asked for (Panda).
        actions: (length, n_actions) float32, if asked for; with the seed they repeat the episode.
        seen: (length, n_features) float32, what the policy saw, if asked for.
        finished: False where it was broken off (reflex stop, operator): then nothing but `seed` and `why` holds.
        why: what broke it off, in a sentence.
    """

    seed: int
    return_: float
    length: int
    terminated: bool
    failed: bool
    success: bool | None
    action_change: float
    dimension: MeshDimension | None = None
    motion: TipMotion | None = None
    tip_position: NDArray[np.float32] | None = None
    tip_velocity: NDArray[np.float32] | None = None
    actions: NDArray[np.float32] | None = None
    seen: NDArray[np.float32] | None = None
    finished: bool = True
    why: str = ""


def unfinished(seed: int, why: str) -> Episode:
    """An episode that was broken off; its numbers are not numbers, so that nobody takes them for a whole one's."""
    return Episode(seed, math.nan, 0, False, False, None, math.nan, finished=False, why=why)


def wrong_action(environment: str, seed: int) -> DrsError:
    """What every backend says instead of taking a step with such an action."""
    return DrsError(f"{environment} with seed {seed}: the policy gave an action that is not finite.")


def wrong_state(environment: str, seed: int) -> DrsError:
    """What every backend says of such an episode."""
    return DrsError(f"{environment} with seed {seed} gave a reward or observation that is not finite.")


_ROWS = 1000


class EpisodeRunner:
    """Runs episodes of one agent's policy in one environment; close it when done."""

    def __init__(self, agent: Agent, fast: bool = True) -> None:
        """Make the agent's environment; `fast` as in `Environment`.

        Raises:
            UsageError: the agent's sizes do not fit it.
        """
        self._environment = Environment(agent.environment, fast)
        self._policy, self._assembler, self._main = agent.policy(), agent.assembler(), agent.pipeline.main
        spaces = self._environment.spaces
        timed = agent.pipeline.time_limit_steps is not None
        expected = {part.key: part.size - (timed and part.key == MAIN) for part in agent.pipeline.parts}
        if expected != spaces.parts or len(spaces.low) != len(agent.low):
            self.close()
            raise UsageError(
                f"The agent observes {expected} and gives {len(agent.low)} actions, but {agent.environment} "
                f"gives {spaces.parts} and takes {len(spaces.low)}: the agent is of another environment."
            )
        self.has_tip = agent.environment.startswith("Panda")
        # what an episode saw and did, a row a step; reused by the next one
        self._seen = np.empty((_ROWS, agent.pipeline.size), dtype=np.float32)
        self._actions = np.empty((_ROWS, len(agent.low)), dtype=np.float32)

    @property
    def environment(self) -> Environment:
        """Where the episodes run."""
        return self._environment

    def load(self, theta: Float32) -> None:
        """Act with theta (d,) from now on."""
        self._policy.load(theta)

    def run(self, seed: int, measure: frozenset[str] = frozenset()) -> Episode:
        """Run the episode of this seed; `measure` holds some of DIMENSION, MOTION, TRAJECTORY, ACTIONS, SEEN.

        Raises:
            DrsError: the policy gave an action, or the environment a reward or observation, that is not finite. What
                the simulator holds then may reach into later episodes: close the runner and make another.
        """
        environment, assembler, policy = self._environment, self._assembler, self._policy
        tip: list[NDArray[np.floating]] = []
        total, length = 0.0, 0
        observation = environment.reset(seed)
        while True:
            if length == len(self._seen):
                self._seen, self._actions = _twice(self._seen), _twice(self._actions)
            features = assembler.features(observation, length, self._seen[length])
            action = policy.act(features, self._actions[length])
            # before it reaches a simulator, which would keep it; the sum is the quickest look at a few numbers
            if not math.isfinite(sum(action.tolist())):
                finite = np.isfinite(features).all()
                raise (wrong_action if finite else wrong_state)(environment.id, seed)
            observation, reward, terminated, truncated, success = environment.step(action)
            total += reward
            length += 1
            if self.has_tip and isinstance(observation, Mapping):
                # panda-gym: position and velocity of the tip come first
                tip.append(observation[MAIN][:6])
            if terminated or truncated:
                break
        states = self._seen[:length]
        if not (np.isfinite(total) and np.isfinite(states).all()):
            raise wrong_state(environment.id, seed)
        path = np.array(tip, dtype=np.float32) if tip else None
        wants_path = path is not None and TRAJECTORY in measure
        return Episode(
            seed=seed,
            return_=total,
            length=length,
            terminated=terminated,
            failed=terminated and not success and length < environment.spaces.time_limit_steps,
            success=success,
            action_change=mean_action_change(self._actions[:length]),
            dimension=measure_dimension(states[:, self._main]) if DIMENSION in measure else None,
            motion=tip_motion(path) if path is not None and MOTION in measure else None,
            tip_position=path[:, :3] if path is not None and wants_path else None,
            tip_velocity=path[:, 3:] if path is not None and wants_path else None,
            actions=self._actions[:length].copy() if ACTIONS in measure else None,
            seen=states.copy() if SEEN in measure else None,
        )

    def close(self) -> None:
        """Free the simulator."""
        self._environment.close()


def _twice(rows: Float32) -> Float32:
    return np.concatenate((rows, np.empty_like(rows)))
