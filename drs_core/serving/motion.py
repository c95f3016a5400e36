"""From joint targets to commands within velocity, acceleration, jerk and position limits; by Ruckig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import le
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import DrsError, install
from drs_core.serving.arm import JOINTS, JointLimits
from drs_core.serving.config import ServingConfig
from drs_core.serving.extrema import profile_extrema

Float64 = NDArray[np.float64]
Allowed = Callable[[Float64], bool]

_EVERY_S, _MOST_SAMPLES = 0.02, 64
"""Time between the moments of a plan at which `allowed` is asked, and most of them; a policy's step plans 0.2 s."""
_ROUNDING_RAD = 1e-9
_HEADROOM = 1.0 - 1e-6
"""Part of the limits that plans use, so that rounding does not end above them."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A commanded moment: positions [rad], velocities [rad/s] and accelerations [rad/s^2], (7,) each."""

    positions: Float64
    velocities: Float64
    accelerations: Float64


def used_limits(limits: JointLimits, config: ServingConfig) -> JointLimits:
    """The part of an arm's limits that serving uses: scaled, with a margin to the ends of the joints."""
    return JointLimits(
        position_min_rad=limits.position_min_rad + config.joint_margin_rad,
        position_max_rad=limits.position_max_rad - config.joint_margin_rad,
        velocity_max_rad_s=limits.velocity_max_rad_s * config.velocity_scale,
        acceleration_max_rad_s2=limits.acceleration_max_rad_s2 * config.acceleration_scale,
        jerk_max_rad_s3=limits.jerk_max_rad_s3 * config.jerk_scale,
    )


class MotionLimiter:
    """A plan that is always safe to follow to its end, and ends at rest.

    A new plan begins at the commanded moment, whatever the arm measures, and takes the place of the
    old one only if all of it lies within the position limits and is allowed; otherwise the old one goes on. So there
    is no moment from which the limits cannot be kept. Commands are moments of one plan or of plans
    that join smoothly; the finite differences of their positions are means of its derivatives, and
    keep the same limits at any rate.
    """

    def __init__(self, limits: JointLimits, period_s: float, allowed: Allowed | None = None) -> None:
        """Prepare plans.

        Args:
            limits: to keep.
            period_s: between two commands.
            allowed: whether joint positions (7,) [rad] keep what is not a limit of a joint, such as the
                workspace; asked along a new plan.

        Raises:
            DrsError: Ruckig is not installed.
        """
        try:
            import ruckig
        except ImportError as error:
            raise DrsError(f"Motion limits need Ruckig; {install('serve')}.") from error
        self.limits, self._period_s, self._allowed, self._ruckig = limits, period_s, allowed, ruckig
        self._low, self._high = limits.position_min_rad.tolist(), limits.position_max_rad.tolist()
        self._quickest = limits.velocity_max_rad_s.tolist()
        self._planner = ruckig.Ruckig(JOINTS)
        self._to_target = self._problem(ruckig.ControlInterface.Position, ruckig.Synchronization.Time)
        self._to_rest = self._problem(ruckig.ControlInterface.Velocity, ruckig.Synchronization.No)
        self._plan, self._spare = ruckig.Trajectory(JOINTS), ruckig.Trajectory(JOINTS)
        self._time_s = 0.0
        self.now = Motion(np.zeros(JOINTS), np.zeros(JOINTS), np.zeros(JOINTS))

    def start(self, positions: Float64) -> bool:
        """Forget everything and be at rest at positions (7,) [rad]; false where these are not allowed."""
        if not self._within(positions.tolist(), positions.tolist()):
            return False
        self.now = Motion(positions.copy(), np.zeros(JOINTS), np.zeros(JOINTS))
        return self.aim(positions)

    def aim(self, target: Float64) -> bool:
        """Plan to rest at a target (7,) [rad]; false where the old plan goes on because no new one keeps the limits."""
        found = self._found_to(target)
        if found:
            self._adopt()
        return found

    def rehearse(self, target: Float64) -> None:
        """Find the plan of `aim` and let it go."""
        if self._found_to(target):
            self._spare.at_time(self._period_s)

    def stop(self) -> bool:
        """Plan to rest as soon as the limits allow; false where the old plan, which ends at rest too, goes on."""
        found = self._found(self._to_rest)
        if found:
            self._adopt()
        return found

    def advance(self) -> Motion:
        """The commanded moment one period later."""
        self._time_s += self._period_s
        if self.at_rest:
            # Ruckig goes on with what rounding has left of the velocity, and the arm would creep
            end = np.array(self._plan.at_time(self._plan.duration)[0])
            self.now = Motion(end, np.zeros(JOINTS), np.zeros(JOINTS))
        else:
            self.now = Motion(*map(np.array, self._plan.at_time(self._time_s)))
        return self.now

    @property
    def at_rest(self) -> bool:
        """Whether the plan has come to its end."""
        return bool(self._time_s >= self._plan.duration)

    def _found_to(self, target: Float64) -> bool:
        if not self._within(target.tolist(), target.tolist()):
            return False
        self._to_target.target_position = target.tolist()
        return self._found(self._to_target)

    def _found(self, problem: Any) -> bool:
        """Whether there is a plan that keeps everything; it is the spare one then."""
        problem.current_position = self.now.positions.tolist()
        problem.current_velocity = self.now.velocities.tolist()
        problem.current_acceleration = self.now.accelerations.tolist()
        try:
            result = self._planner.calculate(problem, self._spare)
        except self._ruckig.RuckigError:
            return False
        if result not in (self._ruckig.Result.Working, self._ruckig.Result.Finished):
            return False
        inside = self._stays_far_inside(self._spare) or self._stays_inside(self._spare)
        return inside and self._all_allowed(self._spare)

    def _adopt(self) -> None:
        self._plan, self._spare, self._time_s = self._spare, self._plan, 0.0

    def _stays_far_inside(self, plan: Any) -> bool:
        """Whether a plan is too short to come near the end of a joint, which is nearly always so, and soon said."""
        starts, ends, half_s = self.now.positions.tolist(), plan.at_time(plan.duration)[0], 0.5 * plan.duration
        # within vmax t of its start and vmax (T - t) of its end
        return all(
            low + half_s * most <= start <= high - half_s * most and low + half_s * most <= end <= high - half_s * most
            for low, start, end, high, most in zip(self._low, starts, ends, self._high, self._quickest)
        )

    def _stays_inside(self, plan: Any) -> bool:
        lowest, highest = zip(*map(profile_extrema, plan.profiles[0]))
        return self._within([low + _ROUNDING_RAD for low in lowest], [high - _ROUNDING_RAD for high in highest])

    def _all_allowed(self, plan: Any) -> bool:
        allowed, at_time = self._allowed, plan.at_time
        if allowed is None:
            return True
        samples = min(int(plan.duration / _EVERY_S) + 1, _MOST_SAMPLES)
        step_s = plan.duration / samples
        return all([allowed(np.array(at_time(step_s * i)[0])) for i in range(1, samples + 1)])

    def _within(self, lowest: Sequence[float], highest: Sequence[float]) -> bool:
        # written so that NaN is outside
        return all(map(le, self._low, lowest)) and all(map(le, highest, self._high))

    def _problem(self, interface: Any, synchronization: Any) -> Any:
        problem = self._ruckig.InputParameter(JOINTS)
        problem.control_interface, problem.synchronization = interface, synchronization
        problem.max_velocity = (self.limits.velocity_max_rad_s * _HEADROOM).tolist()
        problem.max_acceleration = (self.limits.acceleration_max_rad_s2 * _HEADROOM).tolist()
        problem.max_jerk = (self.limits.jerk_max_rad_s3 * _HEADROOM).tolist()
        problem.target_velocity = problem.target_acceleration = [0.0] * JOINTS
        return problem
