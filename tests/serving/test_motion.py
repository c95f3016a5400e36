"""Whatever the targets, commands keep the limits as finite differences, at any rate."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.serving.arm import JOINTS, read_arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.guards import publishable
from drs_core.serving.motion import Motion, MotionLimiter, used_limits

wild = st.one_of(
    st.floats(-4.0, 4.0), st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0.0, 1e300, -1e12])
)
near = st.floats(-0.2, 0.2)
targets = st.one_of(
    st.tuples(st.just("far"), st.lists(wild, min_size=JOINTS, max_size=JOINTS)),
    st.tuples(st.just("corner"), st.lists(st.floats(0.0, 1.0), min_size=JOINTS, max_size=JOINTS)),
    st.tuples(st.just("near"), st.lists(near, min_size=JOINTS, max_size=JOINTS)),
    st.tuples(st.just("stop"), st.just([0.0] * JOINTS)),
)


@settings(max_examples=120, deadline=None)
@given(
    arm_id=st.sampled_from(["panda", "fr3"]),
    scale=st.sampled_from([0.05, 0.5, 1.0]),
    period_s=st.sampled_from([0.001, 0.01, 0.04]),
    way=st.lists(st.tuples(targets, st.integers(1, 12)), min_size=1, max_size=25),
)
def test_no_command_leaves_the_limits(arm_id, scale, period_s, way):
    arm = read_arm(arm_id)
    limits = used_limits(arm.limits, ServingConfig(velocity_scale=scale, acceleration_scale=scale, jerk_scale=scale))
    limiter = MotionLimiter(limits, period_s)
    assert limiter.start(arm.neutral_rad)
    history = np.tile(arm.neutral_rad, (4, 1))
    low, high = limits.position_min_rad, limits.position_max_rad
    for (kind, values), commands in way:
        numbers = np.array(values)
        if kind == "stop":
            limiter.stop()
        elif kind == "far":
            limiter.aim(numbers)
        elif kind == "corner":
            limiter.aim(low + numbers * (high - low))
        else:
            limiter.aim(limiter.now.positions + numbers)
        for _ in range(commands):
            history = np.vstack((history[1:], limiter.advance().positions))
            assert publishable(history, limits, period_s) is None


def test_it_arrives_at_rest_and_stops_sooner_than_it_arrives():
    arm = read_arm("panda")
    limits = used_limits(arm.limits, ServingConfig())
    target, counts = arm.neutral_rad + 0.3, {}
    for told in ("arrive", "stop"):
        limiter = MotionLimiter(limits, 0.01)
        limiter.start(arm.neutral_rad)
        assert limiter.aim(target)
        for _ in range(12):
            limiter.advance()
        if told == "stop":
            assert limiter.stop()
        counts[told] = 0
        while not limiter.at_rest:
            limiter.advance()
            counts[told] += 1
        assert not limiter.now.velocities.any() or np.abs(limiter.now.velocities).max() < 1e-9
    assert counts["stop"] < 0.5 * counts["arrive"]


def test_what_is_not_allowed_is_never_planned():
    arm = read_arm("panda")
    limits = used_limits(arm.limits, ServingConfig())
    limiter = MotionLimiter(limits, 0.01, allowed=lambda q: bool(q[0] <= 0.2))
    assert limiter.start(arm.neutral_rad)
    rng, farthest = np.random.default_rng(0), 0.0
    for _ in range(200):
        limiter.aim(arm.neutral_rad + rng.uniform(-0.1, 0.4, JOINTS))
        for _ in range(20):
            farthest = max(farthest, float(limiter.advance().positions[0]))
    # between the moments at which it is asked, a plan may bulge a little
    assert 0.15 < farthest < 0.205


def test_a_plan_that_would_leave_the_range_is_not_taken():
    # no plan leads here: too fast to stop before the end
    arm = read_arm("panda")
    limits = used_limits(arm.limits, ServingConfig())
    limiter = MotionLimiter(limits, 0.01)
    limiter.start(arm.neutral_rad)
    positions, velocities = arm.neutral_rad.copy(), np.zeros(JOINTS)
    positions[0], velocities[0] = limits.position_max_rad[0] - 0.01, 1.0
    limiter.now = Motion(positions, velocities, np.zeros(JOINTS))
    assert not limiter.aim(arm.neutral_rad) and not limiter.stop()
    assert np.allclose(limiter.advance().positions, arm.neutral_rad)


def test_the_very_end_of_a_range_can_be_reached():
    arm = read_arm("panda")
    limits = used_limits(arm.limits, ServingConfig())
    limiter = MotionLimiter(limits, 0.01)
    limiter.start(arm.neutral_rad)
    for end in (limits.position_max_rad, limits.position_min_rad):
        assert limiter.aim(end)
        while not limiter.at_rest:
            limiter.advance()
        assert np.allclose(limiter.now.positions, end, atol=1e-8)


@pytest.mark.parametrize("where", [np.nan, 3.0])
def test_it_starts_only_within_the_limits(where):
    arm = read_arm("panda")
    positions = arm.neutral_rad.copy()
    positions[0] = where
    assert not MotionLimiter(used_limits(arm.limits, ServingConfig()), 0.01).start(positions)
