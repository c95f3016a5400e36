"""The whole way: every fault by name, and whatever comes in, nothing wrong goes out."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.serving.config import ServingConfig
from drs_core.serving.guards import in_box, publishable, workspace
from drs_core.serving.inputs import Inputs
from drs_core.serving.results import Effect, Result, Verdict
from drs_core.serving.states import ACTIVE, MOVING, Event, State
from tests.serving.conftest import Loop


def joints(inputs: Inputs, **changes) -> Inputs:
    return dataclasses.replace(inputs, joints=dataclasses.replace(inputs.joints, **changes))


def pose(inputs: Inputs, which: str, **changes) -> Inputs:
    return dataclasses.replace(inputs, **{which: dataclasses.replace(getattr(inputs, which), **changes)})


def spoiled(values, index, value):
    copy = np.array(values, dtype=np.float64)
    copy[index] = value
    return copy


def late(inputs: Inputs) -> Inputs:
    return pose(joints(inputs, stamp_s=inputs.joints.stamp_s - 1.0), "tip", stamp_s=inputs.tip.stamp_s - 1.0)


# the elbow and the hand, which leaves the tip in the workspace
SHIFT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4])

CHANGES = {
    "joint NaN": lambda i: joints(i, positions=spoiled(i.joints.positions, 2, np.nan)),
    "joint inf": lambda i: joints(i, velocities=spoiled(i.joints.velocities, 6, np.inf)),
    "joint huge": lambda i: joints(i, positions=spoiled(i.joints.positions, 0, 1e300)),
    "velocity huge": lambda i: joints(i, velocities=spoiled(i.joints.velocities, 0, 1e200)),
    "joint missing": lambda i: joints(
        i, names=i.joints.names[1:], positions=i.joints.positions[1:], velocities=i.joints.velocities[1:]
    ),
    "joints permuted": lambda i: joints(
        i, names=i.joints.names[::-1], positions=i.joints.positions[::-1], velocities=i.joints.velocities[::-1]
    ),
    "joints under wrong names": lambda i: joints(i, names=i.joints.names[::-1]),
    "another arm": lambda i: joints(i, names=[name.replace("panda", "fr3") for name in i.joints.names]),
    "jump": lambda i: joints(i, positions=i.joints.positions + 0.5),
    "jump, no tip pose": lambda i: dataclasses.replace(joints(i, positions=i.joints.positions + SHIFT), tip=None),
    "stale": late,
    "from the future": lambda i: joints(i, stamp_s=i.joints.stamp_s + 1.0),
    "tip NaN": lambda i: pose(i, "tip", position=(np.nan, 0.0, 0.0)),
    "tip elsewhere": lambda i: pose(i, "tip", position=np.array(i.tip.position) + 0.1),
    "goal inf": lambda i: pose(i, "goal", position=(np.inf, 0.0, 0.0)),
    "goal outside": lambda i: pose(i, "goal", position=(0.6, 0.0, -0.2)),
    "goal in another frame": lambda i: pose(i, "goal", frame="world"),
    "no goal": lambda i: dataclasses.replace(i, goal=None),
    "no joints": lambda i: dataclasses.replace(i, joints=None),
    "no tip pose": lambda i: dataclasses.replace(i, tip=None),
}

WHILE_RUNNING = {
    "joint NaN": (Result.NOT_FINITE, State.FAULT, "panda_joint3"),
    "joint inf": (Result.NOT_FINITE, State.FAULT, "panda_joint7"),
    "joint huge": (Result.MISMATCH, State.FAULT, "apart"),
    "velocity huge": (Result.NOT_FINITE, State.FAULT, "too large"),
    "joint missing": (Result.INCOMPLETE, State.FAULT, "lack panda_joint1"),
    "joints permuted": (Result.OK, State.RUNNING, "follows the policy"),
    "joints under wrong names": (Result.MISMATCH, State.FAULT, "apart"),
    "another arm": (Result.INCOMPLETE, State.FAULT, "lack panda_joint1"),
    "jump": (Result.MISMATCH, State.FAULT, "apart"),
    "jump, no tip pose": (Result.NOT_FOLLOWING, State.FAULT, "rad from its command"),
    "stale": (Result.STALE, State.HOLDING, "is 1 s; allowed"),
    "from the future": (Result.CLOCK, State.FAULT, "1 s ahead"),
    "tip NaN": (Result.NOT_FINITE, State.FAULT, "tip pose"),
    "tip elsewhere": (Result.MISMATCH, State.FAULT, "0.173 m apart"),
    "goal inf": (Result.NOT_FINITE, State.FAULT, "goal"),
    "goal outside": (Result.GOAL_OUTSIDE, State.HOLDING, "-0.200"),
    "goal in another frame": (Result.WRONG_FRAME, State.FAULT, "'world', not in 'panda_link0'"),
    "no goal": (Result.NO_INPUT, State.HOLDING, "goal"),
    "no joints": (Result.NO_INPUT, State.HOLDING, "Joint states"),
    "no tip pose": (Result.OK, State.RUNNING, "follows the policy"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_comes_in_while_it_runs(loop, name):
    result, state, words = WHILE_RUNNING[name]
    for _ in range(3):
        assert loop.step().result is Result.OK
    verdict = loop.server.observe(CHANGES[name](loop.inputs()), loop.now_s)
    assert verdict.result is result, verdict.sentence
    assert loop.server.stand.state is state and words in loop.server.stand.sentence
    if state is State.FAULT:
        # nothing more, whatever comes, until it is reset and told to go again
        assert loop.move() == 0 and loop.step().result is Result.NOT_ACTIVE and loop.move() == 0
        for event in (Event.ACTIVATE, Event.GOOD_INPUT, Event.CONFIGURE, Event.DEACTIVATE, Event.CLEAN_UP):
            loop.server.tell(event)
            assert loop.server.stand.state is State.FAULT and loop.move() == 0
        loop.server.tell(Event.RESET)
        assert loop.server.stand.state is State.INACTIVE and loop.move() == 0
        loop.robot.reset()
        loop.server.tell(Event.ACTIVATE)
        assert loop.step().result is Result.OK
    elif state is State.HOLDING:
        # brought to rest, then silent, then on as before
        assert loop.move() > 0
        while loop.move():
            pass
        assert not loop.robot.reflex and np.abs(loop.robot.velocities).max() < 0.01
        assert loop.step().result is Result.OK and loop.server.stand.state is State.RUNNING
    assert not loop.robot.reflex


@pytest.mark.parametrize("name", CHANGES)
def test_what_comes_in_before_it_runs_moves_nothing(loop, name):
    result, state, _ = WHILE_RUNNING[name]
    if result is Result.NOT_FOLLOWING:
        # before the first command there is nothing to follow
        result, state = Result.OK, State.RUNNING
    loop.step(CHANGES[name](loop.inputs()))
    expected = {State.HOLDING: State.WAITING}.get(state, state)
    assert loop.server.stand.state is expected
    assert bool(loop.published) == (result is Result.OK)


def test_silence_stops_it_smoothly(loop):
    for _ in range(5):
        loop.step()
    speed = np.abs(loop.robot.velocities).max()
    while loop.move():
        pass
    assert not np.ptp(loop.published[-4:], axis=0).any()
    assert speed > 0.1 and loop.server.stand.state is State.HOLDING
    assert "too old" in loop.server.stand.sentence and not loop.robot.reflex
    assert loop.step().result is Result.OK


def test_a_doubt_stops_it_short_of_its_target(loop):
    loop.goal = (0.6, -0.35, 0.4)
    for _ in range(5):
        loop.step()
    target = loop.server.answer.target.joints
    loop.server.report(Verdict(Result.NO_INPUT))
    while loop.move():
        pass
    assert np.abs(loop.published[-1] - target).max() > 0.01
    assert np.ptp(loop.published[-5:], axis=0).any() and not np.ptp(loop.published[-4:], axis=0).any()


def test_a_clock_that_goes_back_is_a_fault(loop):
    for _ in range(3):
        loop.step()
    loop.now_s -= 0.5
    assert loop.server.command(loop.now_s) is None
    assert loop.server.stand.state is State.FAULT and "back by 0.4" in loop.server.stand.sentence


def test_a_flood_of_inputs_is_answered_at_its_own_rate():
    calls = []

    def act(seen, step):
        calls.append(step)
        return np.zeros(3, np.float32)

    loop = Loop(act).activate()
    results = []
    for millisecond in range(1000):
        loop.now_s = 100.0 + 1e-3 * millisecond
        results.append(loop.server.observe(loop.inputs(), loop.now_s).result)
        motion = loop.server.command(loop.now_s)
        if motion is not None:
            loop.published.append(motion.positions)
    assert set(results) == {Result.OK, Result.TOO_SOON}
    assert len(calls) <= 51 and len(loop.published) <= 201
    assert calls == list(range(len(calls)))


def test_a_rehearsal_leaves_no_trace():
    told = []
    for rehearsed in (False, True):
        rng, loop, answers = np.random.default_rng(3), Loop().activate(), []
        for step in range(200):
            if step % 20 == 0:
                # some cannot be reached, or are none
                loop.goal = rng.uniform([0.2, -0.45, 0.0], [0.85, 0.45, 0.65]) if step % 60 else (np.nan, 0.0, 0.2)
            if rehearsed:
                before = loop.server.stand, loop.server.answer
                loop.server.rehearse(loop.inputs(), loop.now_s - 0.003)
                assert (loop.server.stand, loop.server.answer) == before
            loop.step()
            answer = loop.server.answer
            answers.append((loop.server.stand, answer and (answer.number, answer.step, answer.target.joints.tobytes())))
            if loop.server.stand.state is State.FAULT:
                loop.server.tell(Event.RESET)
                loop.server.tell(Event.ACTIVATE)
        told.append((answers, np.array(loop.published).tobytes()))
    assert told[0] == told[1] and len({stand.state for stand, _ in told[0][0]}) > 2


def test_a_stop_while_the_policy_thinks_drops_its_answer():
    loop = Loop(lambda seen, step: think()).activate()
    told = []

    def think():
        if len(told) == 3:
            loop.server.report(Verdict(Result.OTHER_PUBLISHER, "/planner too."))
        told.append(loop.server.stand.epoch)
        return np.ones(3, np.float32)

    for _ in range(3):
        assert loop.step().result is Result.OK
    count = len(loop.published)
    assert loop.step().result is Result.DROPPED
    assert loop.server.stand.state is State.FAULT and "/planner" in loop.server.stand.sentence
    assert len(loop.published) == count and loop.server.answer is None


@pytest.mark.parametrize(
    "action", [np.full(3, np.nan), np.array([np.inf, 0, 0]), np.zeros(2), np.zeros(4), "nonsense", None]
)
def test_an_action_that_is_none_is_a_fault(action):
    loop = Loop(lambda seen, step: action).activate()
    assert loop.step().result is Result.BAD_ACTION
    assert loop.server.stand.state is State.FAULT and not loop.published


def test_an_agent_that_refuses_is_a_fault_with_its_words():
    def act(seen, step):
        raise UsageError("Seven parts, not three.")

    loop = Loop(act).activate()
    assert loop.step().result is Result.BAD_ACTION and "Seven parts" in loop.server.stand.sentence


def test_commands_do_not_run_away_from_an_arm_that_is_held_back(loop):
    loop.robot.command = lambda positions: None
    loop.goal = (0.6, -0.25, 0.45)
    before = loop.kinematics.tip_position(loop.robot.positions)
    for _ in range(60):
        assert loop.step().result is Result.OK
    commanded = loop.kinematics.tip_position(loop.published[-1])
    assert np.linalg.norm(commanded - before) < 2 * loop.config.step_max_m


@pytest.mark.parametrize("moving", [True, False])
def test_it_starts_from_rest_within_the_limits(loop, moving):
    if moving:
        loop.robot.velocities[2] = 0.2
    else:
        loop.robot.positions[3] = -3.05
    inputs = dataclasses.replace(loop.inputs(), tip=None)
    verdict = loop.server.observe(inputs, loop.now_s)
    assert verdict.result in ({Result.NOT_AT_REST} if moving else {Result.JOINT_OUTSIDE, Result.TIP_OUTSIDE})
    assert loop.server.stand.state is State.WAITING and loop.move() == 0


def test_it_does_not_start_on_the_edge_of_the_workspace(loop):
    low, high = loop.server.limits.position_min_rad, loop.server.limits.position_max_rad
    down = np.array([1.0, 0.0, 0.0, 0.0])
    start = loop.robot.positions
    for height_m, result in ((0.005, Result.TIP_OUTSIDE), (0.015, Result.OK)):
        loop.robot.positions = loop.kinematics.inverse(
            start, np.array([0.6, 0.0, height_m]), down, (low, high)
        ).positions
        loop.robot.reset()
        assert loop.server.observe(loop.inputs(), loop.now_s).result is result
        loop.now_s += 1.0


def test_the_tip_pose_may_be_of_another_point_of_the_hand():
    config = ServingConfig(pose_from_hand_m=0.1034)
    loop = Loop(config=config).activate()
    for _ in range(2):
        inputs = loop.inputs()
        tcp = np.array(inputs.tip.position) + np.array([0.0, 0.0, 0.0016])
        down = loop.kinematics.tip_orientation(loop.robot.positions)
        verdict = loop.step(pose(inputs, "tip", position=tcp, orientation=down))
        assert verdict.result is Result.OK
    moved = loop.server.answer.target.position - np.array(inputs.tip.position)
    assert np.linalg.norm(moved) <= config.step_max_m + 1e-5


actions = st.one_of(
    st.lists(st.floats(-1.0, 1.0, width=32), min_size=3, max_size=3),
    st.sampled_from([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [0.0, 0.0, -1.0], [1e30, -1e30, 1e30]]),
)
happenings = st.tuples(
    st.one_of(st.just("good"), st.sampled_from(sorted(CHANGES))),
    actions,
    st.sampled_from([0, 1, 1, 1, 1, 2, 5]),
    st.sampled_from([0.0, 0.0, 0.0, 0.0, 0.02, -0.01, 0.2, 3.0]),
)


@settings(max_examples=150, deadline=None)
@given(
    arm_id=st.sampled_from(["panda", "fr3"]),
    scale=st.sampled_from([0.2, 1.0]),
    commands_per_period=st.sampled_from([1, 4]),
    story=st.lists(happenings, min_size=1, max_size=40),
)
def test_whatever_comes_in_nothing_wrong_goes_out(arm_id, scale, commands_per_period, story):
    config = ServingConfig(
        velocity_scale=scale, acceleration_scale=scale, jerk_scale=scale, commands_per_period=commands_per_period
    )
    action = [0.0, 0.0, 0.0]
    loop = Loop(lambda seen, step: np.array(action, np.float32), arm_id, config).activate()
    server = loop.server
    chain = np.tile(loop.robot.positions, (4, 1))
    for kind, action, periods, jump_s in story:  # noqa: B007
        if server.stand.state is State.FAULT:
            server.tell(Event.RESET)
            assert server.command(loop.now_s) is None
            server.tell(Event.ACTIVATE)
        before, begins = server.stand.state, server.begins
        if begins and kind == "jump, no tip pose":
            # joint states that lie from the start are nothing that a guard could know
            kind = "good"
        loop.now_s += jump_s
        # the arm goes on by itself, and knows no clock that goes back
        loop.robot.advance(max(0.0, jump_s))
        inputs = loop.inputs()
        verdict = server.observe(inputs if kind == "good" else CHANGES[kind](inputs), loop.now_s)
        if begins and not server.begins:
            # a start begins where the arm is, and where commands have only ended at the last one
            chain = np.tile(loop.robot.positions if before is State.WAITING else chain[-1], (4, 1))
            if before is State.WAITING:
                loop.robot.reset()
        if verdict.result.effect is Effect.FAULT:
            assert server.stand.state is State.FAULT
        for _ in range(periods):
            count = len(loop.published)
            loop.move()
            assert server.stand.state in ACTIVE or count == len(loop.published) or verdict.result is Result.OK
            for positions in loop.published[count:]:
                chain = np.vstack((chain[1:], positions))
                assert publishable(chain, server.limits, config.command_period_s) is None
                tip = loop.kinematics.tip_position(positions)
                assert in_box(tip, workspace(config, config.workspace_margin_m))
        assert not loop.robot.reflex
        assert "would have left" not in server.stand.sentence
        assert (server.stand.state in MOVING) or server.command(loop.now_s) is None
