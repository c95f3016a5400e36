"""Where the policy sends a simulated arm: joint targets by PyBullet's inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent
from drs_core.environments.robot_state import ArmTargets
from drs_core.errors import DrsError


@dataclass(frozen=True)
class Arm:
    """Where the robot was measured to be.

    Attributes:
        positions: (9,) [rad, m], arm then fingers.
        tip_position: (3,) [m], in the frame of the base.
    """

    positions: NDArray[np.float64]
    tip_position: NDArray[np.float64]


def is_panda(agent: Agent) -> bool:
    """Whether it moves a Panda arm."""
    return agent.environment.startswith("Panda")


def arm_targets(agent: Agent) -> tuple[ArmTargets | None, str]:
    """Inverse kinematics for joint_command, or why there are none."""
    if not is_panda(agent):
        return None, ""
    try:
        return ArmTargets(agent.environment), ""
    except DrsError as error:
        return None, f"joint_command is not published: {error}"
