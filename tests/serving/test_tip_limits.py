"""Poses as commands: the limits of the tip's motion, on the serving side and on the mock arm's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.serving.arm import read_arm
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.mock_arm import MockArm, TipControl
from tests.serving.conftest import Loop

LOW, HIGH = (0.3, -0.35, 0.05), (0.75, 0.35, 0.55)


def control(arm_id: str = "panda", period_s: float = 0.01) -> tuple[TipControl, MockArm, np.ndarray, np.ndarray]:
    """A mock arm commanded by poses, and the pose where it is."""
    kinematics = Kinematics(read_arm(arm_id), posture_gain=0.02)
    robot = MockArm(kinematics.arm, kinematics.arm.neutral_rad, period_s)
    q = robot.positions
    return TipControl(robot, kinematics), robot, kinematics.tip_position(q), kinematics.tip_orientation(q)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**31), arm_id=st.sampled_from(["panda", "fr3"]))
def test_the_tip_of_any_policy_keeps_them_and_its_poses_are_followed(seed: int, arm_id: str) -> None:
    rng = np.random.default_rng(seed)
    loop = Loop(lambda seen, step: np.sign(rng.uniform(-1, 1, 3)).astype(np.float32), arm_id).activate()
    follower, robot, _, _ = control(arm_id)
    for step in range(120):
        if step % 40 == 0:
            loop.goal = rng.uniform(LOW, HIGH)
        loop.step()
    for positions in loop.published:
        kinematics = loop.kinematics
        follower.command(kinematics.tip_position(positions), kinematics.tip_orientation(positions))
        robot.advance(0.01)
        assert not robot.reflex
    assert len(loop.published) > 100
    tip = loop.kinematics.tip_position
    assert np.linalg.norm(tip(robot.commanded) - tip(loop.published[-1])) < 1e-6


@pytest.mark.parametrize(
    ("period_s", "step_m", "words"),
    [
        (0.01, 0.05, "velocity is 5"),
        (0.01, 0.002, "acceleration is 20"),
        (0.001, 1e-5, "jerk is 1e+04"),
        (0.01, float("nan"), "not finite"),
    ],
)
def test_a_pose_that_jumps_raises_a_reflex(period_s: float, step_m: float, words: str) -> None:
    follower, robot, tip, down = control(period_s=period_s)
    follower.command(tip, down)
    assert not robot.reflex
    follower.command(tip + np.array((step_m, 0.0, 0.0)), down)
    assert words in robot.reflex


def test_a_pose_out_of_reach_raises_a_reflex_and_a_reset_ends_it() -> None:
    # slow enough that nothing else is broken
    follower, robot, tip, down = control(period_s=1.0)
    follower.command(np.array((1.2, 0.0, 0.3)), down)
    assert "out of reach" in robot.reflex
    robot.reset()
    follower.reset()
    follower.command(tip, down)
    assert not robot.reflex
