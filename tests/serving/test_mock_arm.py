"""The mock arm, and the shipped agent driving it."""

from __future__ import annotations

import numpy as np
import pytest

from drs_core.importing import resolve
from drs_core.panda import TIP_ORIENTATION, tip_target
from drs_core.serving.arm import read_arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.mock_arm import MockArm
from drs_core.serving.results import Result
from drs_core.serving.states import State
from tests.serving.conftest import Loop

ARM = read_arm("panda")
GOAL_LOW, GOAL_HIGH = np.array([0.45, -0.15, 0.0]), np.array([0.75, 0.15, 0.3])
"""panda-gym's goals, in the frame of the base."""


@pytest.fixture(scope="module")
def act():
    agent = resolve("panda_reach")
    policy, assembler = agent.policy(), agent.assembler()
    return lambda seen, step: policy.act(assembler.features(seen, step))


def test_it_lags_like_a_first_order_system_however_time_is_cut():
    ends = []
    for cut in (1, 7, 100):
        robot = MockArm(ARM, ARM.neutral_rad, command_period_s=0.01, time_constant_s=0.02)
        target = ARM.neutral_rad + 1e-4
        robot.command(target)
        for _ in range(cut):
            robot.advance(0.05 / cut)
        ends.append(robot.positions)
    assert np.allclose(ends[0], ends[1], atol=1e-15) and np.allclose(ends[0], ends[2], atol=1e-15)
    # a ramp of 0.01 s, then 0.04 s of decay
    left = 1e-4 * 2.0 * (1.0 - np.exp(-0.5)) * np.exp(-2.0)
    assert np.allclose(target - ends[0], left, rtol=1e-6)


def test_commands_that_end_in_a_motion_leave_it_at_rest():
    def moving() -> MockArm:
        robot = MockArm(ARM, ARM.neutral_rad, command_period_s=0.01)
        for k in range(20):
            robot.command(ARM.neutral_rad + 1e-4 * k * k)
            robot.advance(0.01)
        assert not robot.reflex and robot.velocities.max() > 0.3
        return robot

    robot = moving()
    robot.advance(0.05)
    # a busy computer: what comes next belongs to the motion, and this does not
    robot.command(robot.commanded)
    assert "acceleration" in robot.reflex
    robot = moving()
    robot.advance(0.3)
    robot.command(robot.commanded)
    assert not robot.reflex


@pytest.mark.parametrize(
    ("step", "words"), [(0.1, "velocity"), (0.01, "acceleration"), (np.nan, "finite"), (5.0, "range")]
)
def test_a_broken_limit_is_a_reflex_until_it_is_reset(step, words):
    robot = MockArm(ARM, ARM.neutral_rad)
    robot.command(ARM.neutral_rad + step)
    assert words in robot.reflex
    robot.command(ARM.neutral_rad)
    robot.advance(0.1)
    assert np.array_equal(robot.positions, ARM.neutral_rad) and not robot.velocities.any()
    robot.reset()
    robot.command(ARM.neutral_rad)
    assert not robot.reflex


@pytest.mark.parametrize(
    ("arm_id", "config"),
    [
        ("panda", ServingConfig()),
        ("panda", ServingConfig(velocity_scale=1.0, acceleration_scale=1.0, jerk_scale=1.0, commands_per_period=1)),
        ("fr3", ServingConfig()),
    ],
)
def test_the_shipped_agent_reaches_twenty_goals_without_a_reflex(act, arm_id, config):
    loop, rng = Loop(act, arm_id, config).activate(), np.random.default_rng(0)
    for _ in range(20):
        loop.goal = rng.uniform(GOAL_LOW, GOAL_HIGH)
        nearest = np.inf
        for _ in range(75):
            assert loop.step().result is Result.OK
            nearest = min(nearest, loop.distance())
        assert nearest < 0.05
    assert not loop.robot.reflex and loop.server.stand.state is State.RUNNING


def test_the_same_agent_without_guards_trips_it_at_once(act):
    loop, kinematics = Loop(act), Kinematics(ARM)
    robot = MockArm(ARM, ARM.neutral_rad, command_period_s=0.04)
    bounds = ARM.limits.position_min_rad, ARM.limits.position_max_rad
    commands = 0
    while not robot.reflex and commands < 50:
        tip = kinematics.tip_position(robot.positions)
        goal = np.array(loop.goal)
        seen = {
            "achieved_goal": tip - [0.6, 0.0, 0.0],
            "desired_goal": goal - [0.6, 0.0, 0.0],
            "observation": np.concatenate(
                (tip - [0.6, 0.0, 0.0], kinematics.tip_velocity(robot.positions, robot.velocities))
            ),
        }
        target = tip_target(act(seen, commands), tip)
        robot.command(kinematics.inverse(robot.positions, target, np.array(TIP_ORIENTATION), bounds).positions)
        robot.advance(0.04)
        commands += 1
    assert commands <= 3 and robot.reflex
