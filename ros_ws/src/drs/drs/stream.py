"""An environment that runs on, command by command, free of ROS: what the simulator's topics show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.environments import Environment, Step
from drs_core.environments.robot_state import (
    RobotState,
    period_s,
    read_state,
    take_joint_targets,
    take_tip_targets,
)
from drs_core.errors import UsageError

INTERFACES = ("action", "joint_command", "target_pose")


@dataclass(frozen=True)
class Frame:
    """One moment.

    Attributes:
        number: counts frames, from 1.
        seed: of the episode.
        count: steps taken in the episode.
        time_s: simulated time since the stream began.
        step: what the last step gave; reward 0 after a reset.
        state: of the robot, where there is one.
    """

    number: int
    seed: int
    count: int
    time_s: float
    step: Step
    state: RobotState | None

    @property
    def done(self) -> bool:
        """Whether the episode ended here."""
        return self.step.terminated or self.step.truncated


class Stream:
    """One episode after another, with seeds that count up."""

    def __init__(self, environment_id: str, interface: str = "action", fast: bool = True) -> None:
        """Make the environment and begin the episode of seed 0; `fast` as in `Environment`.

        Raises:
            UsageError: the environment is unknown, or does not know this command interface.
        """
        if interface not in INTERFACES:
            raise UsageError(f"There is no command interface {interface!r}; choose one of {', '.join(INTERFACES)}.")
        self.environment = Environment(environment_id, fast)
        self.interface, self.period_s = interface, period_s(self.environment)
        if interface == "joint_command":
            take_joint_targets(self.environment)
        elif interface == "target_pose":
            take_tip_targets(self.environment)
        self._number, self._time_s = 0, 0.0
        self.reset(0)

    def reset(self, seed: int) -> Frame:
        """Begin the episode of this seed."""
        observation = self.environment.reset(seed)
        self._seed, self._count = seed, 0
        self._held: NDArray[np.floating] | None = None
        return self._frame(Step(observation, 0.0, False, False, None))

    def step(self, command: NDArray[np.floating] | None) -> Frame:
        """Move on by one step, or after an ending to the next episode.

        Args:
            command: action (n_actions,), or targets (9,) of the joints or of the tip and the
                fingers. None holds: targets stay as they are, and an action is 0.
        """
        if self.frame.done:
            return self.reset(self._seed + 1)
        if command is not None:
            self._held = command
        elif self.interface == "action" or self._held is None:
            self._held = self._rest()
        self._count += 1
        return self._frame(self.environment.step(self._held))

    def close(self) -> None:
        """Free the simulator."""
        self.environment.close()

    def _rest(self) -> NDArray[np.floating]:
        state = self.frame.state
        if self.interface == "action" or state is None:
            spaces = self.environment.spaces
            return np.clip(np.zeros_like(spaces.low), spaces.low, spaces.high)
        if self.interface == "joint_command":
            return state.positions
        return np.concatenate((state.tip_position, state.tip_orientation, state.positions[7:]))

    def _frame(self, step: Step) -> Frame:
        self._number += 1
        self._time_s += self.period_s
        self.frame = Frame(self._number, self._seed, self._count, self._time_s, step, read_state(self.environment))
        return self.frame
