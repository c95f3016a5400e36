"""What happens where commands have ended while the policy is active: the next motion begins from rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drs_core.errors import UsageError
from drs_core.serving.config import ServingConfig
from drs_core.serving.mock_arm import MockArm
from drs_core.serving.results import Result
from drs_core.serving.states import State
from tests.serving.conftest import Loop


def running(loop: Loop) -> Loop:
    """In the middle of a motion."""
    for _ in range(6):
        assert loop.step().result is Result.OK
    assert np.abs(loop.robot.velocities).max() > 0.1
    return loop


def rested(loop: Loop) -> Loop:
    """At a goal, and silent since the goal is gone."""
    while loop.distance() > 0.01:
        loop.step()
    goal, loop.goal = loop.goal, (0.6, 0.0, -0.5)
    loop.step()
    while loop.move():
        pass
    assert loop.server.stand.state is State.HOLDING and loop.server.begins
    loop.goal = goal
    return loop


@pytest.mark.parametrize("gap_s", [0.11, 0.19, 0.21, 1.0, 100.0])
def test_after_a_gap_it_begins_from_rest_at_its_last_command(loop, gap_s):
    last = running(loop).published[-1]
    loop.now_s += gap_s
    loop.robot.advance(gap_s)
    assert loop.step().result is Result.OK
    assert loop.server.stand.state is State.HOLDING
    assert "Commands were interrupted" in loop.server.stand.sentence
    assert loop.published[-1] is last, "no command of the old plan comes after the gap"
    silent_s = loop.now_s - gap_s
    count = len(loop.published)
    while len(loop.published) == count:
        began_s = loop.now_s
        assert loop.step().result in (Result.OK, Result.NOT_AT_REST)
    assert began_s - silent_s > 0.35 and loop.server.stand.state is State.RUNNING
    assert np.abs(loop.published[count] - last).max() < 1e-3
    while loop.distance() > 0.01:
        loop.step()
    assert not loop.robot.reflex


def test_a_gap_of_a_busy_computer_is_none(loop):
    running(loop)
    loop.now_s += 0.08
    assert loop.step().result is Result.OK and loop.server.stand.state is State.RUNNING


def test_simulated_time_in_coarse_steps_has_no_gaps(loop):
    """A /clock of 10 Hz: all that is due in a step comes at once."""
    held = 0
    for tick in range(200):
        loop.now_s = 100.0 + 0.1 * tick
        loop.server.observe(loop.inputs(), loop.now_s)
        motion = loop.server.command(loop.now_s)
        held += loop.server.stand.state is State.HOLDING
        if motion is not None:
            loop.robot.command(motion.positions)
            loop.robot.advance(loop.config.command_period_s)
    assert not held and loop.distance() < 0.01


def test_slow_commands_are_no_gaps():
    loop = Loop(config=ServingConfig(policy_period_s=1.0, commands_per_period=1, input_age_max_s=2.0)).activate()
    while loop.distance() > 0.01:
        assert loop.step().result is Result.OK and loop.server.stand.state is State.RUNNING
    assert not loop.robot.reflex


def test_it_does_not_begin_before_the_arm_is_at_rest(loop):
    running(loop)
    velocities = loop.robot.velocities
    loop.now_s += 1.0
    loop.server.command(loop.now_s)
    loop.robot.velocities = velocities
    assert loop.server.observe(loop.inputs(), loop.now_s).result is Result.NOT_AT_REST
    assert loop.server.command(loop.now_s) is None


def test_a_clock_that_is_set_forward_is_no_gap(loop):
    running(loop)
    steady_s = 5.0
    loop.server.command(loop.now_s, steady_s)
    loop.now_s += 3600.0
    # inputs are too old, so it is brought to rest, and not let alone in mid-motion
    assert loop.server.command(loop.now_s, steady_s + 0.01) is not None
    assert loop.server.stand.state is State.HOLDING and not loop.server.begins


@pytest.mark.parametrize("back_s", [0.5, 3600.0])
def test_a_clock_that_was_set_back_is_found_where_nobody_calls_any_more(loop, back_s):
    running(loop)
    loop.server.watch(loop.now_s)
    assert loop.server.stand.state is State.RUNNING
    loop.server.watch(loop.now_s - back_s)
    assert loop.server.stand.state is State.FAULT and "went back" in loop.server.stand.sentence
    loop.server.watch(math.nan)
    assert "went back" in loop.server.stand.sentence


def test_an_arm_that_is_elsewhere_after_a_silence_is_met_where_it_is(loop):
    rested(loop)
    # its driver is started again, at the neutral posture
    loop.robot = MockArm(loop.arm, loop.arm.neutral_rad, loop.config.command_period_s)
    assert np.abs(loop.published[-1] - loop.arm.neutral_rad).max() > 0.1
    count = len(loop.published)
    assert loop.step().result is Result.OK and loop.server.stand.state is State.RUNNING
    assert np.abs(loop.published[count] - loop.arm.neutral_rad).max() < 1e-3
    while loop.distance() > 0.01:
        loop.step()
    assert not loop.robot.reflex


@pytest.mark.parametrize("droop_rad", [0.004, 0.02, 0.05])
def test_an_arm_that_has_kept_its_last_command_goes_on_from_there(loop, droop_rad):
    last = rested(loop).published[-1]
    # what a controller or gravity leaves, which would be a jump of each command that follows a pause
    loop.robot.positions = loop.robot.positions + droop_rad * np.eye(7)[1]
    count = len(loop.published)
    loop.step()
    assert np.abs(loop.published[count] - last).max() < 1e-3


def test_at_rest_it_does_not_creep():
    rng = np.random.default_rng(0)
    for _ in range(20):
        action = rng.uniform(-1.0, 1.0, 3).astype(np.float32)
        loop = Loop(lambda seen, step, action=action: action).activate()
        for _ in range(8):
            loop.step()
        loop.goal = (0.6, 0.0, -0.5)
        loop.step()
        for _ in range(100):
            loop.move()
        assert loop.move() == 0 and loop.server.begins


@pytest.mark.parametrize("low, high", [((0.2, -0.4, 0.0, 0.1), (0.8, 0.4)), ((0.2,) * 6, ()), ((), (1.0,) * 6)])
def test_corners_have_three_numbers_each(low, high):
    with pytest.raises(UsageError, match="three finite numbers each"):
        ServingConfig(workspace_min_m=low, workspace_max_m=high)
