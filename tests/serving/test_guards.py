"""Each guard by itself: what it lets through, what it finds, and the sentence."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from drs_core.errors import UsageError
from drs_core.serving import guards
from drs_core.serving.arm import read_arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.inputs import ArmState, Inputs, JointSample, PoseSample, arm_state
from drs_core.serving.motion import used_limits
from drs_core.serving.results import Effect, Result, Verdict

ARM, CONFIG = read_arm("panda"), ServingConfig()
POSE = PoseSample("panda_link0", (0.5, 0.0, 0.2), (1.0, 0.0, 0.0, 0.0), 10.0)
JOINTS = JointSample(ARM.joints, ARM.neutral_rad, np.zeros(7), 10.0)
INPUTS = Inputs(JOINTS, POSE, POSE)


def test_every_result_has_a_sentence_and_the_fault_ones_say_so():
    sentences = [result.sentence for result in Result]
    assert len(set(sentences)) == len(sentences) and all(sentence.endswith(".") for sentence in sentences)
    assert {result.effect for result in Result} == set(Effect)
    assert Verdict(Result.STALE, "By 1 s.").sentence == "An input is too old. By 1 s."


def test_joints_are_found_by_name_in_any_order_with_others_among_them():
    rng = np.random.default_rng(0)
    names = [*ARM.joints, *ARM.fingers, "head", "wheel"]
    q, v = rng.normal(size=11), rng.normal(size=11)
    order = rng.permutation(11)
    state = arm_state(JointSample([names[i] for i in order], q[order], v[order], 0.0), ARM, True)
    assert np.array_equal(state.positions, q[:7]) and np.array_equal(state.velocities, v[:7])
    assert state.finger_width_m == pytest.approx(q[7] + q[8])


@pytest.mark.parametrize(
    ("names", "positions", "velocities", "result", "words"),
    [
        (ARM.joints[:6], np.zeros(6), np.zeros(6), Result.INCOMPLETE, "lack panda_joint7"),
        (ARM.joints, np.zeros(6), np.zeros(7), Result.INCOMPLETE, "7 names, 6 positions"),
        (ARM.joints, np.zeros(7), [], Result.INCOMPLETE, "0 velocities"),
        ((), [], [], Result.INCOMPLETE, "lack panda_joint1"),
        ((*ARM.joints, "panda_joint3"), np.zeros(8), np.zeros(8), Result.INCOMPLETE, "panda_joint3 more than once"),
        (ARM.joints, [0, 0, np.nan, 0, 0, 0, 0], np.zeros(7), Result.NOT_FINITE, "panda_joint3"),
        (ARM.joints, np.zeros(7), [0, 0, 0, 0, 0, 0, -np.inf], Result.NOT_FINITE, "panda_joint7"),
        (read_arm("fr3").joints, np.zeros(7), np.zeros(7), Result.INCOMPLETE, "lack panda_joint1"),
    ],
)
def test_joint_states_that_are_not_those_of_the_arm(names, positions, velocities, result, words):
    found = arm_state(JointSample(names, positions, velocities, 0.0), ARM, False)
    assert found.result is result and words in found.sentence


@pytest.mark.parametrize(
    ("pose", "result", "words"),
    [
        ({"position": (0.5, np.nan, 0.0)}, Result.NOT_FINITE, "The name"),
        ({"orientation": (np.inf, 0, 0, 0)}, Result.NOT_FINITE, "The name"),
        ({"orientation": (0.0, 0.0, 0.0, 0.0)}, Result.INCOMPLETE, "norm 0"),
        ({"orientation": (1e200, 0.0, 0.0, 0.0)}, Result.INCOMPLETE, "norm"),
        ({"position": (0.5, 0.0)}, Result.INCOMPLETE, "2 + 4 numbers"),
    ],
)
def test_poses_that_are_none(pose, result, words):
    for name in ("tip", "goal", "object"):
        changed = dataclasses.replace(INPUTS, **{name: dataclasses.replace(POSE, **pose)})
        found = guards.finite_poses(changed)
        assert found.result is result and words.replace("name", name) in found.sentence
    assert guards.finite_poses(INPUTS) is None


def test_velocities_that_are_none():
    for name, size in (("tip_velocity", 3), ("object_velocity", 6)):
        good = dataclasses.replace(INPUTS, **{name: np.zeros(size)})
        assert guards.finite_poses(good) is None
        bad = dataclasses.replace(INPUTS, **{name: np.full(size, np.nan)})
        assert guards.finite_poses(bad).result is Result.NOT_FINITE
        short = dataclasses.replace(INPUTS, **{name: np.zeros(2)})
        assert guards.finite_poses(short).result is Result.INCOMPLETE


def test_a_pose_in_another_frame_is_found():
    goal = dataclasses.replace(POSE, frame="world")
    found = guards.right_frames(dataclasses.replace(INPUTS, goal=goal), "panda_link0")
    assert found.result is Result.WRONG_FRAME and "'world'" in found.sentence
    assert guards.right_frames(INPUTS, "panda_link0") is None


@pytest.mark.parametrize(
    ("now_s", "tip_s", "result"),
    [
        (10.0, 10.0, None),
        (10.1, 10.0, None),
        (10.11, 10.0, Result.STALE),
        (9.96, 10.0, None),
        (9.9, 10.0, Result.CLOCK),
        (10.1, 10.04, None),
        (10.1, 10.06, Result.STALE),
        (10.0, np.nan, Result.NOT_FINITE),
        (10.0, -np.inf, Result.NOT_FINITE),
    ],
)
def test_inputs_are_of_now_and_of_one_moment(now_s, tip_s, result):
    goal = dataclasses.replace(POSE, stamp_s=0.0)
    inputs = Inputs(JOINTS, goal, dataclasses.replace(POSE, stamp_s=tip_s))
    found = guards.fresh(inputs, now_s, CONFIG)
    assert (found and found.result) is result


def test_goal_and_tip_outside_the_workspace_are_told_apart():
    good, outside = np.array([0.5, 0.0, 0.2]), np.array([0.5, 0.0, -0.01])
    assert guards.inside(good, good, CONFIG) is None
    assert guards.inside(outside, good, CONFIG).result is Result.GOAL_OUTSIDE
    assert guards.inside(good, outside, CONFIG).result is Result.TIP_OUTSIDE
    assert guards.inside(good, np.full(3, np.nan), CONFIG).result is Result.TIP_OUTSIDE


def test_a_step_is_limited_and_ends_in_the_workspace():
    tip = np.array([0.5, 0.0, 0.04])
    assert np.allclose(guards.limited_step(np.array([0.7, 0.0, 0.04]), tip, CONFIG), [0.55, 0.0, 0.04])
    assert np.allclose(guards.limited_step(np.array([0.5, 0.0, 0.0]), tip, CONFIG), [0.5, 0.0, 0.02])


def test_an_arm_that_moves_or_does_not_follow_is_found():
    moving = ArmState(ARM.neutral_rad, np.array([0, 0, 0, 0.06, 0, 0, 0.0]))
    assert guards.at_rest(moving, CONFIG).result is Result.NOT_AT_REST
    assert guards.following(ARM.neutral_rad, ARM.neutral_rad + 0.31, CONFIG).result is Result.NOT_FOLLOWING
    assert guards.following(np.full(7, np.nan), ARM.neutral_rad, CONFIG).result is Result.NOT_FOLLOWING
    assert guards.tip_matches(np.zeros(3), np.array([0, 0, 0.06]), CONFIG).result is Result.MISMATCH
    limits = used_limits(ARM.limits, CONFIG)
    bounds = limits.position_min_rad, limits.position_max_rad
    found = guards.joints_inside(np.array([0, 0, 0, 0.0, 0, 1, 0]), *bounds, ARM.joints)
    assert found.result is Result.JOINT_OUTSIDE and "panda_joint4" in found.sentence


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h: h[3].fill(np.nan), "finite"),
        (lambda h: h[3].__setitem__(3, 0.1), "range"),
        (lambda h: h[3].__setitem__(0, 0.1), "velocity"),
        (lambda h: h[3].__setitem__(0, 0.01), "acceleration"),
    ],
)
def test_the_last_check_finds_what_no_plan_should_do(change, words):
    history = np.tile(ARM.neutral_rad, (4, 1))
    assert guards.publishable(history, ARM.limits, 0.01) is None
    change(history)
    assert words in guards.publishable(history, ARM.limits, 0.01).sentence


def test_jerk_is_checked_too():
    # at 1 kHz: within acceleration, at once
    history = np.tile(ARM.neutral_rad, (4, 1))
    history[3, 0] += 14.0 * 1e-6
    assert "jerk" in guards.publishable(history, ARM.limits, 0.001).sentence


@pytest.mark.parametrize(
    "wrong",
    [
        {"policy_period_s": 0.0},
        {"policy_period_s": float("nan")},
        {"velocity_scale": 1.01},
        {"jerk_scale": -1.0},
        {"joint_margin_rad": 0.0},
        {"step_max_m": "far"},
        {"commands_per_period": 0},
        {"commands_per_period": 2.5},
        {"workspace_min_m": (0.9, 0.0, 0.0)},
        {"workspace_max_m": (0.9, float("inf"), 1.0)},
    ],
)
def test_settings_out_of_range_are_refused_with_their_value(wrong):
    value = next(iter(wrong.values()))
    with pytest.raises(UsageError) as error:
        ServingConfig(**wrong)
    assert str(value[0] if isinstance(value, tuple) else value) in str(error.value)
