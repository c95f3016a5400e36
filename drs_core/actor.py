"""What an agent answers to an observation that somebody else made: checked on the way in and out."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.observation import MAIN
from drs_core.policy import Float32

WARM_UP_STEPS = 20


class Actor:
    """The maximum likelihood action of one agent.

    Attributes:
        agent: that acts.
        digest: sha256 over everything that decides what it does.
        sizes: of the parts of an observation, by key.
    """

    def __init__(self, agent: Agent) -> None:
        """Prepare the policy and run it a few times, so that the first answer is as quick as the others."""
        self.agent, self.digest = agent, agent.digest()
        self._policy, self._assembler = agent.policy(), agent.assembler()
        timed = agent.pipeline.time_limit_steps is not None
        self.sizes = {part.key: part.size - (timed and part.key == MAIN) for part in agent.pipeline.parts}
        for step in range(WARM_UP_STEPS):
            self.act({key: np.zeros(size) for key, size in self.sizes.items()}, step)

    def features(self, observation: Mapping[str, NDArray[np.floating]], step: int) -> Float32:
        """What the policy sees, (n_features,) float32.

        Raises:
            UsageError: the observation is of another environment.
        """
        found = {key: len(values) for key, values in observation.items()}
        if found != self.sizes:
            raise UsageError(f"The observation has parts {found}, but the agent observes {self.sizes}.")
        return self._assembler.features(observation, step)

    def act(self, observation: Mapping[str, NDArray[np.floating]], step: int) -> Float32:
        """Action (n_actions,) float32 for an observation after `step` steps of its episode.

        Raises:
            UsageError: the observation is of another environment, or so far out that the action is not finite.
        """
        action = self._policy.act(self.features(observation, step))
        if not all(map(math.isfinite, action.tolist())):
            raise UsageError("The policy's action is not finite; the observation is far from what it was trained on.")
        return action

    def answer(self, observation: Mapping[str, NDArray[np.floating]], step: int) -> Float32:
        """As `act`, for whoever has seen to the parts' sizes before and looks at the action himself."""
        return self._policy.act(self._assembler.features(observation, step))
