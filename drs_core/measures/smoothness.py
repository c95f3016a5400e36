"""How smoothly an arm's tip moves, from its sampled positions and velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CONTROL_PERIOD_S = 0.04
"""panda-gym: 20 substeps of 1/500 s."""


@dataclass(frozen=True)
class TipMotion:
    """Smoothness of one episode; all but the last over its second half, where the tip has arrived.

    Attributes:
        speed_mean: mean |v| [m/s].
        jerk_mean_square: mean |d2v/dt2|^2, by second differences of the velocity [(m/s^3)^2].
        position_std: root of the summed variances of the three coordinates [m].
        velocity_sign_flips: changes of sign of a velocity component [1/step], mean of the three.
        log_dimensionless_jerk: see `log_dimensionless_jerk`, over the whole episode; higher is smoother.
    """

    speed_mean: float
    jerk_mean_square: float
    position_std: float
    velocity_sign_flips: float
    log_dimensionless_jerk: float


def mean_action_change(actions: NDArray[np.floating]) -> float:
    """Mean |a_t - a_(t-1)| over steps and components of actions (steps, n_actions); 0 for one step."""
    if len(actions) < 2:
        return 0.0
    return float(np.abs(np.diff(actions.astype(np.float64), axis=0)).mean())


def tip_motion(path: NDArray[np.floating], period_s: float = CONTROL_PERIOD_S) -> TipMotion:
    """Smoothness of a path (steps, 6): position [m] and velocity [m/s] after every step.

    Of an episode of 50 steps the second half is steps 25 to 50.
    """
    late = path[max(len(path) // 2 - 1, 0) :].astype(np.float64)
    position, velocity = late[:, :3], late[:, 3:]
    jerk = np.diff(velocity, 2, axis=0) / period_s**2
    flips = np.diff(np.sign(velocity), axis=0) != 0.0
    return TipMotion(
        speed_mean=float(np.linalg.norm(velocity, axis=1).mean()),
        jerk_mean_square=float(np.square(jerk).sum(axis=1).mean()) if len(jerk) else 0.0,
        position_std=float(np.sqrt(position.var(axis=0).sum())),
        velocity_sign_flips=float(flips.mean()) if len(flips) else 0.0,
        log_dimensionless_jerk=log_dimensionless_jerk(path[:, 3:], period_s),
    )


def log_dimensionless_jerk(velocity: NDArray[np.floating], period_s: float) -> float:
    """-ln( T^3 / v_peak^2 * integral of |d2v/dt2|^2 dt ) of velocity (steps, 3) [m/s].

    Source: Balasubramanian, Melendez-Calderon, Roby-Brami, Burdet, "On the analysis of movement
    smoothness", J. NeuroEng. Rehabil. 12:112 (2015). 0 for a path without jerk or motion.
    """
    v = velocity.astype(np.float64)
    peak = float(np.linalg.norm(v, axis=1).max(initial=0.0))
    jerk = np.diff(v, 2, axis=0) / period_s**2
    duration = (len(v) - 1) * period_s
    integral = float(np.square(jerk).sum()) * period_s
    if peak == 0.0 or integral == 0.0:
        return 0.0
    return -math.log(duration**3 / peak**2 * integral)
