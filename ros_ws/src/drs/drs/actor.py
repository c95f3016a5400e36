"""What the policy node does with an observation, free of ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent
from drs_core.environments.robot_state import ArmTargets
from drs_core.errors import DrsError, UsageError
from drs_core.observation import MAIN
from drs_core.policy import Float32

WARM_UP_STEPS = 20


@dataclass(frozen=True)
class Arm:
    """Where the robot was measured to be.

    Attributes:
        positions: (9,) [rad, m], arm then fingers.
        tip_position: (3,) [m], in the frame of the base.
    """

    positions: NDArray[np.float64]
    tip_position: NDArray[np.float64]


class Actor:
    """The maximum likelihood action of one agent."""

    def __init__(self, agent: Agent) -> None:
        """Prepare the policy and run it a few times, so that the first answer is as quick as the others."""
        self.agent, self.digest = agent, agent.digest()
        self._policy, self._assembler = agent.policy(), agent.assembler()
        timed = agent.pipeline.time_limit_steps is not None
        self._sizes = {part.key: part.size - (timed and part.key == MAIN) for part in agent.pipeline.parts}
        for step in range(WARM_UP_STEPS):
            self.act({key: np.zeros(size) for key, size in self._sizes.items()}, step)

    @property
    def is_panda(self) -> bool:
        """Whether it moves a Panda arm."""
        return self.agent.environment.startswith("Panda")

    def act(self, observation: Mapping[str, NDArray[np.float64]], step: int) -> Float32:
        """Action (n_actions,) float32 for an observation after `step` steps of its episode.

        Raises:
            UsageError: the observation is of another environment.
        """
        sizes = {key: len(values) for key, values in observation.items()}
        if sizes != self._sizes:
            raise UsageError(f"The observation has parts {sizes}, but the agent observes {self._sizes}.")
        action = self._policy.act(self._assembler.features(observation, step))
        if not np.isfinite(action).all():
            raise UsageError("The policy's action is not finite; the observation is far from what it was trained on.")
        return action


def arm_targets(agent: Agent) -> tuple[ArmTargets | None, str]:
    """Inverse kinematics for joint_command, or why there are none."""
    if not agent.environment.startswith("Panda"):
        return None, ""
    try:
        return ArmTargets(agent.environment), ""
    except DrsError as error:
        return None, f"joint_command is not published: {error}"
