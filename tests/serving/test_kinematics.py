"""Kinematics agree with Bullet's, and always answer."""

import gymnasium
import numpy as np
import panda_gym  # noqa: F401
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.environments.quiet import quiet
from drs_core.errors import UsageError
from drs_core.panda import BASE_FROM_WORLD_M, TIP_ORIENTATION
from drs_core.serving.arm import read_arm
from drs_core.serving.kinematics import MAX_ITERATIONS, Kinematics

ARM = read_arm("panda")
LOW, HIGH = BOUNDS = ARM.limits.position_min_rad, ARM.limits.position_max_rad
DOWN = np.array(TIP_ORIENTATION)
TIP = 11


@pytest.fixture(scope="module")
def env():
    with quiet():
        env = gymnasium.make("PandaReach-v3").unwrapped
    env.reset(seed=0)
    yield env
    env.close()


def put(env, positions, velocities=None):
    body, client = env.sim._bodies_idx["panda"], env.sim.physics_client
    for joint in range(7):
        client.resetJointState(body, joint, positions[joint], 0.0 if velocities is None else velocities[joint])
    return client, body


def test_tip_and_its_velocity_are_bullets_everywhere(env):
    kinematics, rng = Kinematics(ARM), np.random.default_rng(0)
    for _ in range(200):
        positions, velocities = rng.uniform(LOW, HIGH), rng.normal(size=7)
        client, body = put(env, positions, velocities)
        link = client.getLinkState(body, TIP, computeLinkVelocity=1, computeForwardKinematics=1)
        assert np.allclose(kinematics.tip_position(positions) - BASE_FROM_WORLD_M, link[0], atol=1e-9)
        assert np.allclose(kinematics.tip_velocity(positions, velocities), link[6], atol=1e-9)
        ours = kinematics.tip_orientation(positions)
        assert min(np.abs(ours - link[1]).max(), np.abs(ours + link[1]).max()) < 1e-9


def test_inverse_kinematics_are_bullets_once_those_have_converged(env):
    """Errors over the workspace; panda-gym itself takes Bullet's first 20 iterations, which end short of the target."""
    kinematics, rng = Kinematics(ARM), np.random.default_rng(1)
    joint, ours, theirs, first, longer = [], [], [], [], []
    for _ in range(200):
        # a legal posture with the hand down, then a step of the policy
        here = kinematics.inverse(ARM.neutral_rad, rng.uniform([0.4, -0.2, 0.05], [0.7, 0.2, 0.35]), DOWN, BOUNDS)
        if not here.converged:
            continue
        client, body = put(env, here.positions)
        target = kinematics.tip_position(here.positions) + rng.uniform(-0.05, 0.05, 3)
        world = target - BASE_FROM_WORLD_M
        exact = client.calculateInverseKinematics(
            body, TIP, world, DOWN, maxNumIterations=2000, residualThreshold=1e-12
        )
        short = env.robot.inverse_kinematics(link=TIP, position=world, orientation=DOWN)
        solution = kinematics.inverse(here.positions, target, DOWN, BOUNDS)
        if not solution.converged:
            continue
        bullets = np.array(exact[:7])
        joint.append(np.abs(solution.positions - bullets).max())
        ours.append(np.linalg.norm(kinematics.tip_position(solution.positions) - target))
        theirs.append(np.linalg.norm(kinematics.tip_position(bullets) - target))
        first.append(np.linalg.norm(kinematics.tip_position(np.array(short[:7])) - target))
        longer.append(np.linalg.norm(solution.positions - here.positions) / np.linalg.norm(bullets - here.positions))
    figures = {
        "postures": len(joint),
        "joints [rad]": (np.median(joint), np.max(joint)),
        "tip, ours [m]": np.max(ours),
        "tip, Bullet converged [m]": np.max(theirs),
        "tip, panda-gym [m]": (np.median(first), np.max(first)),
        "length of the joint step against Bullet's": (np.min(longer), np.max(longer)),
    }
    print(figures)
    assert len(joint) > 150, figures
    assert np.median(joint) < 1e-3 and np.max(joint) < 0.02, figures
    assert np.max(ours) < 1e-6 and np.max(theirs) < 1e-5, figures
    assert np.max(longer) < 1.01, figures
    assert np.max(first) < 0.05, figures


numbers = st.floats(-4.0, 4.0)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.floats(-10.0, 10.0), min_size=7, max_size=7),
    st.lists(numbers, min_size=3, max_size=3),
    st.sampled_from([DOWN, np.array([0.0, 0.0, 0.0, 1.0]), np.full(4, 0.5), np.array([0.6, 0.0, 0.8, 0.0])]),
    st.sampled_from([0.0, 0.02, 1.0]),
)
def test_whatever_is_asked_it_ends_soon_and_within_the_bounds(start, target, orientation, posture_gain):
    kinematics = Kinematics(ARM, posture_gain=posture_gain)
    solution = kinematics.inverse(np.array(start), np.array(target), orientation, BOUNDS)
    assert solution.iterations <= MAX_ITERATIONS
    assert np.isfinite(solution.positions).all()
    assert (LOW <= solution.positions).all() and (solution.positions <= HIGH).all()
    if solution.converged:
        assert np.allclose(kinematics.tip_position(solution.positions), target, atol=2e-6)


@pytest.mark.parametrize("joint", [0, 2, 5, 6])
def test_next_to_a_limit_the_other_joints_do_what_is_left(joint):
    kinematics, start, high = Kinematics(ARM), ARM.neutral_rad, HIGH.copy()
    high[joint] = start[joint]
    target = kinematics.tip_position(start) + np.array([0.0, 0.03, -0.02])
    assert kinematics.inverse(start, target, DOWN, BOUNDS).positions[joint] > high[joint]
    solution = kinematics.inverse(start, target, DOWN, (LOW, high))
    assert solution.converged and (solution.positions <= high).all()


def test_the_elbow_stays_near_its_posture_however_long_it_runs():
    farthest = {}
    for gain in (0.0, 0.02):
        kinematics, rng, q = Kinematics(ARM, posture_gain=gain), np.random.default_rng(0), ARM.neutral_rad
        farthest[gain] = 0.0
        for _ in range(3000):
            target = np.clip(
                kinematics.tip_position(q) + rng.uniform(-0.05, 0.05, 3), [0.4, -0.25, 0.0], [0.68, 0.25, 0.4]
            )
            solution = kinematics.inverse(q, target, DOWN, BOUNDS)
            assert solution.converged
            q = solution.positions
            farthest[gain] = max(farthest[gain], float(np.abs(q - ARM.neutral_rad).max()))
    assert farthest[0.02] < 1.0 < 2.0 < farthest[0.0]


def test_settings_out_of_range_are_refused():
    with pytest.raises(UsageError, match="tip_from_hand_m"):
        Kinematics(ARM, tip_from_hand_m=float("nan"))
    with pytest.raises(UsageError, match="posture_gain"):
        Kinematics(ARM, posture_gain=1.5)
