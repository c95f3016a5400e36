"""Where the tip is, how fast it moves, and which joint positions bring it somewhere; by Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import hypot
from operator import gt, lt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import DrsError, UsageError, install
from drs_core.serving.arm import JOINTS, Arm

Float64 = NDArray[np.float64]
Bounds = tuple[Float64, Float64]

TIP_FROM_HAND_M = 0.105
"""panda-gym's tip, panda_grasptarget; panda_hand_tcp is at 0.1034."""
MAX_ITERATIONS = 20
"""Most that one solution takes, which bounds its time; steps of a policy take 1 to 3."""
POSITION_TOLERANCE_M = 1e-6
ROTATION_TOLERANCE_RAD = 1e-6
_ENOUGH_M, _ENOUGH_RAD = 0.5 * POSITION_TOLERANCE_M, 0.5 * ROTATION_TOLERANCE_RAD
_DAMPING = 1e-8
_DAMPING_BY_ERROR = 0.1
_MAX_STEP_RAD = 0.3


@dataclass(frozen=True, eq=False)
class Solution:
    """What inverse kinematics found.

    Attributes:
        positions: (7,) [rad], within the bounds whether it converged or not.
        position_error_m, rotation_error_rad: what is left between these positions' tip and the target.
        iterations: steps that it took.
    """

    positions: Float64
    position_error_m: float
    rotation_error_rad: float
    iterations: int

    @property
    def converged(self) -> bool:
        """Whether the tip is at the target."""
        return self.position_error_m <= POSITION_TOLERANCE_M and self.rotation_error_rad <= ROTATION_TOLERANCE_RAD


class Kinematics:
    """Kinematics of one arm, in preallocated buffers; not for several threads at once."""

    def __init__(self, arm: Arm, tip_from_hand_m: float = TIP_FROM_HAND_M, posture_gain: float = 0.0) -> None:
        """Build the chain from the arm's numbers.

        Args:
            arm: its geometry.
            tip_from_hand_m: the tip, along the hand's z.
            posture_gain: part of its way back to the neutral posture that the elbow goes with each
                solution. With 0 nothing pulls it, as in panda-gym, and in minutes it wanders off;
                an episode there begins anew after two seconds.

        Raises:
            UsageError: a number is out of its range.
            DrsError: Pinocchio is not installed.
        """
        if not abs(tip_from_hand_m) < 1.0:
            raise UsageError(f"tip_from_hand_m is {tip_from_hand_m}; allowed are numbers between -1 and 1.")
        if not 0.0 <= posture_gain <= 1.0:
            raise UsageError(f"posture_gain is {posture_gain}; allowed are 0 to 1.")
        try:
            import eigenpy
            import pinocchio
        except ImportError as error:
            raise DrsError(f"Kinematics need Pinocchio; {install('serve')}.") from error
        self._pin, self.arm, self._posture_gain = pinocchio, arm, posture_gain
        # Cholesky's, in a third of the time that numpy takes for so small a matrix
        self._solver = eigenpy.LLT(np.identity(6))
        self._square = np.empty((6, 6))
        self._diagonal = self._square.reshape(-1)[::7]
        self._model = model = pinocchio.Model()
        parent = 0
        for name, a, d, alpha in zip(arm.joints, arm.dh_a_m, arm.dh_d_m, arm.dh_alpha_rad):
            placement = _placement(pinocchio, "x", alpha, (a, 0.0, 0.0)) * _placement(pinocchio, "z", 0.0, (0, 0, d))
            parent = model.addJoint(parent, pinocchio.JointModelRZ(), placement, name)
        tip = _placement(pinocchio, "z", arm.hand_yaw_rad, (0.0, 0.0, arm.flange_m + tip_from_hand_m))
        self._tip = model.addFrame(pinocchio.Frame("tip", parent, 0, tip, pinocchio.FrameType.OP_FRAME))
        self._data = model.createData()
        # a reference: it is where the tip was found last
        self._placement = self._data.oMf[self._tip]
        self._forward = partial(pinocchio.framesForwardKinematics, model, self._data)
        self._jacobian = partial(pinocchio.computeFrameJacobian, model, self._data)
        self._rotations: dict[tuple[float, ...], Float64] = {}

    def tip_position(self, positions: Float64) -> Float64:
        """Tip of joint positions (7,) [rad], (3,) [m] in the frame of the base."""
        return np.array(self.tip(positions))

    def tip(self, positions: Float64) -> tuple[float, float, float]:
        """The same as three numbers."""
        self._forward(positions)
        position: tuple[float, float, float] = tuple(self._placement.translation.tolist())
        return position

    def tip_orientation(self, positions: Float64) -> Float64:
        """Orientation of the hand, (4,) x, y, z, w in the frame of the base."""
        self._forward(positions)
        # named, since what coeffs gives may be a view of it
        quaternion = self._pin.Quaternion(self._placement.rotation)
        orientation: Float64 = quaternion.coeffs().copy()
        return orientation

    def tip_velocity(self, positions: Float64, velocities: Float64) -> Float64:
        """The tip's velocity, (3,) [m/s] along the axes of the base: J(q) q'.

        Args:
            positions: (7,) [rad].
            velocities: (7,) [rad/s].
        """
        jacobian = self._jacobian(positions, self._tip, self._pin.LOCAL_WORLD_ALIGNED)
        velocity: Float64 = jacobian[:3] @ velocities
        return velocity

    def inverse(self, start: Float64, position: Float64, orientation: Float64, bounds: Bounds) -> Solution:
        """Joint positions that bring the tip to a pose: the nearest ones, by damped least squares.

        Levenberg-Marquardt steps whose damping falls with the error (Sugihara 2011), each the
        shortest in joint space, as in Bullet. A joint that would leave its bounds stays there, and the
        others do what is left.

        Args:
            start: (7,) [rad] where the arm is.
            position: (3,) [m] in the frame of the base.
            orientation: (4,) x, y, z, w, a unit quaternion.
            bounds: (7,) [rad] each, the lowest and the highest result.
        """
        target = self._pin.SE3(self._rotation(orientation), position)
        q: Float64 = start if _lies_between(bounds[0], start, bounds[1]) else start.clip(*bounds)
        # part of the elbow's way back, as far as the first step leaves the tip alone; the others mend what is left
        pull = self._posture_gain * (self.arm.neutral_rad - q) if self._posture_gain else None
        error, distance, angle = self._error(q, target)
        iteration = 0
        while (iteration < MAX_ITERATIONS and not (distance <= _ENOUGH_M and angle <= _ENOUGH_RAD)) or pull is not None:
            jacobian = self._jacobian(q, self._tip, self._pin.LOCAL)
            damping = _DAMPING + _DAMPING_BY_ERROR * (distance * distance + angle * angle)
            q, pull = self._step(q, jacobian, error, damping, bounds, pull), None
            error, distance, angle = self._error(q, target)
            iteration += 1
        return Solution(q, distance, angle, iteration)

    def _rotation(self, orientation: Float64) -> Float64:
        x, y, z, w = key = tuple(orientation.tolist())
        if key not in self._rotations:
            # one policy keeps its hand at one orientation
            self._rotations = {key: self._pin.Quaternion(w, x, y, z).toRotationMatrix()}
        return self._rotations[key]

    def _shortest(self, jacobian: Float64, motion: Float64, damping: float) -> Float64:
        """The shortest way in joint space (7,) that moves the tip so: J^T (J J^T + damping I)^-1 motion."""
        np.dot(jacobian, jacobian.T, out=self._square)
        self._diagonal += damping
        way: Float64 = np.dot(self._solver.compute(self._square).solve(motion), jacobian)
        return way

    def _step(
        self, q: Float64, jacobian: Float64, error: Float64, damping: float, bounds: Bounds, pull: Float64 | None
    ) -> Float64:
        """Joint positions after the shortest step, or the one next to `pull` (7,) where there is one."""
        low, high = bounds
        movable, held = jacobian, np.zeros(JOINTS, dtype=bool)
        while True:
            if pull is None:
                change = self._shortest(movable, error, damping)
            else:
                change = pull + self._shortest(movable, error - movable @ pull, damping)
            longest = max(map(abs, change.tolist()))
            if longest > _MAX_STEP_RAD:
                change *= _MAX_STEP_RAD / longest
            moved: Float64 = q + change
            # nearly always, and soon found
            if _lies_between(low, moved, high):
                return moved
            pushing = ((q <= low) & (change < 0.0)) | ((q >= high) & (change > 0.0))
            # each turn takes a joint out, so there are at most seven
            if not pushing.any():
                return moved.clip(low, high)
            held |= pushing
            movable = jacobian * ~held
            pull = None if pull is None else pull * ~held

    def _error(self, q: Float64, target: Any) -> tuple[Float64, float, float]:
        self._forward(q)
        error: Float64 = self._pin.log6(self._placement.actInv(target)).vector
        x, y, z, rx, ry, rz = error.tolist()
        return error, hypot(x, y, z), hypot(rx, ry, rz)


def _lies_between(low: Float64, values: Float64, high: Float64) -> bool:
    numbers = values.tolist()
    return not (any(map(lt, numbers, low.tolist())) or any(map(gt, numbers, high.tolist())))


def _placement(pin: Any, axis: str, angle_rad: float, translation: tuple[float, float, float]) -> Any:
    return pin.SE3(pin.utils.rotate(axis, angle_rad), np.array(translation, dtype=np.float64))
