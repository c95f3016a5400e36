"""An arm to try things on: it follows commands with a lag, and stops where the real one would."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drs_core.serving.arm import Arm
from drs_core.serving.guards import SILENCE_S, publishable
from drs_core.serving.inputs import JointSample
from drs_core.serving.kinematics import Kinematics

Float64 = NDArray[np.float64]


class MockArm:
    """Seven joints, each a first-order lag behind the commands.

    Between two commands the way is a straight line, as in a trajectory controller. A command that
    breaks a limit of the arm raises a reflex: the arm stops where it is and takes no more commands,
    as the real one, which judges commands in the same way. Where commands end, also in the middle of a
    motion, it comes to rest at the last one, as a controller on the arm would see to; the next begins from there.

    Attributes:
        positions, velocities: (7,) [rad, rad/s] as measured.
        reflex: which limit was broken, or nothing.
        command_period_s: time between commands.
    """

    def __init__(
        self, arm: Arm, positions: Float64, command_period_s: float = 0.01, time_constant_s: float = 0.02
    ) -> None:
        """Begin at rest.

        Args:
            arm: its names and limits.
            positions: (7,) [rad].
            command_period_s: time between commands.
            time_constant_s: of the lag.
        """
        self._arm, self.command_period_s, self._time_constant_s = arm, command_period_s, time_constant_s
        self.positions = np.array(positions, dtype=np.float64)
        self.reset()

    def reset(self) -> None:
        """Forget a reflex and all commands; the arm stays where it is."""
        self.reflex = ""
        self.velocities = np.zeros_like(self.positions)
        self._history = np.tile(self.positions, (4, 1))
        self._since_command_s = self.command_period_s

    def command(self, positions: Float64) -> None:
        """Go to positions (7,) [rad] within one period of commands."""
        if self.reflex:
            return
        self._history[:-1] = self._history[1:]
        self._history[-1] = positions
        found = publishable(self._history, self._arm.limits, self.command_period_s)
        if found is not None:
            self.stop(found.detail)
        self._since_command_s = 0.0

    def stop(self, reflex: str) -> None:
        """Raise a reflex: stay here until it is reset."""
        self.reflex, self.velocities = reflex, np.zeros_like(self.positions)

    @property
    def is_left_alone(self) -> bool:
        """Whether commands have ended."""
        return self._since_command_s > SILENCE_S

    @property
    def commanded(self) -> Float64:
        """The newest command (7,) [rad]."""
        newest: Float64 = self._history[-1]
        return newest

    def advance(self, duration_s: float) -> None:
        """Let time pass: exactly, for the command's straight line [s]."""
        if self.reflex:
            return
        while duration_s > 0.0:
            left_s = self.command_period_s - self._since_command_s
            moving = left_s > 0.0
            step_s = min(duration_s, left_s) if moving else duration_s
            self._follow(step_s, moving)
            self._since_command_s += step_s
            duration_s -= step_s
        if self.is_left_alone:
            self._history[:] = self._history[-1]

    def joint_states(self, stamp_s: float) -> JointSample:
        """What it measures, at a moment [s]."""
        return JointSample(self._arm.joints, self.positions.copy(), self.velocities.copy(), stamp_s)

    def _follow(self, step_s: float, moving: bool) -> None:
        before, after = self._history[-2], self._history[-1]
        slope = (after - before) / self.command_period_s if moving else np.zeros_like(after)
        reference = before + slope * self._since_command_s if moving else after
        # q' = (r + s t - q) / T, solved
        tau = self._time_constant_s
        offset = self.positions - (reference - slope * tau)
        decay = math.exp(-step_s / tau)
        self.positions = reference + slope * (step_s - tau) + offset * decay
        self.velocities = slope - offset * (decay / tau)


class TipControl:
    """Brings the tip of a mock arm to poses, as a Cartesian controller does: each becomes a joint command.

    The limits of the tip's motion are judged too, as the real arm does where it is commanded by poses.
    """

    def __init__(self, robot: MockArm, kinematics: Kinematics) -> None:
        """Take an arm, and kinematics whose posture gain says how much the elbow is pulled to neutral."""
        limits = kinematics.arm.limits
        self._robot, self._kinematics = robot, kinematics
        self._bounds = limits.position_min_rad, limits.position_max_rad
        self.reset()

    def reset(self) -> None:
        """Begin anew, at rest where the arm is."""
        self._history = np.tile(self._kinematics.tip_position(self._robot.commanded), (4, 1))

    def command(self, position: Float64, orientation: Float64) -> None:
        """Go to a pose of the tip within one period of commands; one that cannot be followed raises a reflex.

        Args:
            position: (3,) [m] in the frame of the base.
            orientation: (4,) x, y, z, w.
        """
        if self._robot.reflex:
            return
        if not (np.isfinite(position).all() and np.isfinite(orientation).all() and np.any(orientation)):
            self._robot.stop("A pose is not finite.")
            return
        if self._robot.is_left_alone:
            self.reset()
        self._history[:-1] = self._history[1:]
        self._history[-1] = position
        differences = self._history
        for name, limit in zip(("velocity", "acceleration", "jerk"), self._kinematics.arm.tip_limits):
            differences = np.diff(differences, axis=0) / self._robot.command_period_s
            value = float(np.linalg.norm(differences[-1]))
            if value > limit:
                self._robot.stop(f"The tip's {name} is {value:.3g}, above its limit of {limit:.3g}.")
                return
        unit = orientation / np.linalg.norm(orientation)
        solution = self._kinematics.inverse(self._robot.commanded, position, unit, self._bounds)
        if solution.converged:
            self._robot.command(solution.positions)
        else:
            self._robot.stop(f"A pose is out of reach by {solution.position_error_m:.3g} m.")
