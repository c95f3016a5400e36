import math

import numpy as np
import pytest

from drs_core.measures.smoothness import log_dimensionless_jerk, mean_action_change, tip_motion

PERIOD_S = 0.04


def circle(radius_m, omega, steps=50, dtype=np.float64):
    t = PERIOD_S * np.arange(1, steps + 1)
    position = radius_m * np.stack([np.cos(omega * t), np.sin(omega * t), 0 * t], axis=1)
    velocity = radius_m * omega * np.stack([-np.sin(omega * t), np.cos(omega * t), 0 * t], axis=1)
    return np.concatenate([position, velocity], axis=1).astype(dtype)


def test_a_circle_has_the_speed_and_jerk_of_theory():
    radius_m, omega = 0.1, 2.0
    motion = tip_motion(circle(radius_m, omega, steps=1000), PERIOD_S)
    assert motion.speed_mean == pytest.approx(radius_m * omega)
    assert motion.jerk_mean_square == pytest.approx((radius_m * omega**3) ** 2, rel=5e-3)
    assert motion.position_std == pytest.approx(radius_m, rel=5e-2)


def test_only_steps_25_to_50_count():
    path = np.concatenate([circle(0.5, 30.0, 24), np.tile([0.1, 0.2, 0.3, 0, 0, 0], (26, 1))])
    motion = tip_motion(path)
    assert (motion.speed_mean, motion.jerk_mean_square, motion.velocity_sign_flips) == (0.0, 0.0, 0.0)
    assert motion.position_std == pytest.approx(0.0, abs=1e-12)
    assert motion.log_dimensionless_jerk < -10


def test_flips_and_jerk_of_a_shaking_tip():
    path = np.zeros((50, 6))
    path[:, 3] = np.where(np.arange(50) % 2, 1.0, -1.0)
    motion = tip_motion(path)
    assert motion.velocity_sign_flips == pytest.approx(1 / 3)  # one component of three, at every step
    assert motion.jerk_mean_square == pytest.approx((4 / PERIOD_S**2) ** 2)


def test_the_log_dimensionless_jerk_has_no_units():
    t = np.linspace(0, 1, 400)
    # a minimum-jerk movement of duration and length 1: its integral of jerk squared is 720, its peak speed 1.875
    velocity = np.stack([30 * t**2 - 60 * t**3 + 30 * t**4, 0 * t, 0 * t], axis=1)
    expected = -math.log(720 / 1.875**2)
    assert log_dimensionless_jerk(velocity, t[1]) == pytest.approx(expected, abs=0.05)
    assert log_dimensionless_jerk(7 * velocity, t[1]) == pytest.approx(log_dimensionless_jerk(velocity, 5 * t[1]))
    assert log_dimensionless_jerk(np.zeros((9, 3)), 0.04) == 0.0


def test_action_change():
    assert mean_action_change(np.array([[0.0, 0.0], [1.0, -2.0], [1.0, -2.0]])) == pytest.approx(0.75)
    assert mean_action_change(np.zeros((1, 3))) == 0.0
