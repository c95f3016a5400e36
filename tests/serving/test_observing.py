"""The observation made of an arm's measurements is panda-gym's own."""

import gymnasium
import numpy as np
import panda_gym  # noqa: F401
import pytest

from drs_core.environments.quiet import quiet
from drs_core.panda import BASE_FROM_WORLD_M
from drs_core.serving.arm import read_arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.inputs import Inputs, JointSample, PoseSample
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.measuring import measured
from drs_core.serving.observing import TASKS, Differentiator, euler_angles

SUBSTEP_S = 0.002
ROTATION_M_S = 0.005
"""The tip's way is curved within a substep."""
WIDE = ServingConfig(workspace_min_m=(-2.0, -2.0, -2.0), workspace_max_m=(2.0, 2.0, 2.0), step_max_m=0.1)


class Simulated:
    """Upstream's environment.

    What Bullet reports of a link is half a substep's work behind its joints: the position is of the
    substep before, and the velocity is turned by what the link turned since. With `refreshed` it is
    made to catch up before upstream reads it, so that joints and tip are of one moment as on an arm.
    """

    def __init__(self, environment: str, refreshed: bool = True) -> None:
        with quiet():
            self.env = gymnasium.make(environment).unwrapped
        self.sim, self.robot, self.refreshed = self.env.sim, self.env.robot, refreshed
        self.client = self.sim.physics_client
        self.body = self.sim._bodies_idx["panda"]
        self.tips: list[np.ndarray] = []
        self.tip_velocities: list[np.ndarray] = []
        self.sim.step = self.substeps

    def substeps(self) -> None:
        for _ in range(self.sim.n_substeps):
            self.client.stepSimulation()
            if self.refreshed:
                self.client.getLinkState(self.body, self.robot.ee_link, computeForwardKinematics=1)
            self.tips.append(np.array(self.robot.get_ee_position()) + BASE_FROM_WORLD_M)
            self.tip_velocities.append(np.array(self.robot.get_ee_velocity()))

    def inputs(self, arm, rng) -> Inputs:
        states = self.client.getJointStates(self.body, list(range(7)))
        positions, velocities = [state[0] for state in states], [state[1] for state in states]
        fingers = [self.client.getJointState(self.body, joint)[0] for joint in (9, 10)]
        names = [*arm.joints, *arm.fingers, "camera_joint"]
        q, v = [*positions, *fingers, np.nan], [*velocities, 0.0, 0.0, np.inf]
        order = rng.permutation(len(names))
        joints = JointSample([names[i] for i in order], [q[i] for i in order], [v[i] for i in order], 1.0)
        goal = np.asarray(self.env.task.get_goal(), dtype=np.float64) + BASE_FROM_WORLD_M
        tip = PoseSample(arm.base_frame, self.tips[-1], (1.0, 0.0, 0.0, 0.0), 1.0)
        thing = velocity = None
        if "object" in self.sim._bodies_idx:
            body = self.sim._bodies_idx["object"]
            position, orientation = self.client.getBasePositionAndOrientation(body)
            thing = PoseSample(arm.base_frame, np.array(position) + BASE_FROM_WORLD_M, orientation, 1.0)
            velocity = np.concatenate(self.client.getBaseVelocity(body))
        goal_pose = PoseSample(arm.base_frame, goal, (0.0, 0.0, 0.0, 1.0), 1.0)
        return Inputs(joints, goal_pose, tip, None, thing, velocity)


def worst_difference(environment, tip_from_joints=False, refreshed=True):
    """The largest difference between upstream's observation and ours, over 90 random steps."""
    simulated, arm, rng = Simulated(environment, refreshed), read_arm("panda"), np.random.default_rng(3)
    kinematics, task, worst = Kinematics(arm), TASKS[environment], 0.0
    for seed in range(3):
        simulated.env.reset(seed=seed)
        for _ in range(30):
            theirs = simulated.env.step(rng.uniform(-1, 1, task.actions).astype(np.float32))[0]
            inputs = simulated.inputs(arm, rng)
            if tip_from_joints:
                inputs = Inputs(inputs.joints, inputs.goal, None, None, inputs.object, inputs.object_velocity)
            ours = measured(inputs, 1.0, arm, task, kinematics, WIDE)
            assert set(ours.observation) == set(theirs)
            for key, part in ours.observation.items():
                assert part.dtype == theirs[key].dtype == np.float32 and part.shape == theirs[key].shape
                worst = max(worst, float(np.abs(part - theirs[key]).max()))
    simulated.env.close()
    return worst


@pytest.mark.parametrize("environment", TASKS)
@pytest.mark.parametrize("tip_from_joints", [False, True])
def test_it_is_upstreams_observation_over_random_motions(environment, tip_from_joints):
    assert worst_difference(environment, tip_from_joints) <= 1e-6


def test_what_bullet_lags_is_a_substep_of_motion():
    # so far may training and serving differ: 2 ms at up to 1.7 m/s, and what the hand turns meanwhile
    assert 1e-4 < worst_difference("PandaReach-v3", True, refreshed=False) <= 0.01


@pytest.mark.parametrize("every", [1, 5, 20])
def test_differentiation_is_wrong_by_half_of_what_the_velocity_changes(every):
    simulated, rng = Simulated("PandaReach-v3"), np.random.default_rng(4)
    simulated.env.reset(seed=0)
    for _ in range(60):
        simulated.env.step(rng.uniform(-1, 1, 3).astype(np.float32))
    simulated.env.close()
    velocities = np.array(simulated.tip_velocities)
    differentiator, still, errors = Differentiator(), np.array([0.0, 0.0, 0.0, 1.0]), []
    for k in range(0, len(velocities), every):
        found = differentiator.update(k * SUBSTEP_S, simulated.tips[k], still)
        if found is None:
            continue
        errors.append(np.abs(found[:3] - velocities[k]).max())
        # a mean of the velocities in the interval, each of which lies between the lowest and the highest
        window = velocities[k - every : k + 1]
        allowed = window.max(axis=0) - window.min(axis=0) + ROTATION_M_S
        assert (np.abs(found[:3] - velocities[k]) <= allowed).all()
        assert not found[3:].any()
    print(f"every {1e3 * every * SUBSTEP_S:.0f} ms: median {np.median(errors):.4f}, most {max(errors):.4f} m/s")


def test_a_turning_pose_has_the_angular_velocity_that_turns_it():
    import pinocchio

    rng = np.random.default_rng(0)
    for _ in range(50):
        omega, start = rng.normal(size=3), pinocchio.exp3(rng.normal(size=3))
        differentiator = Differentiator()
        found = None
        for t in (0.0, 0.1):
            turned = pinocchio.exp3(omega * t) @ start
            quaternion = pinocchio.Quaternion(turned).coeffs() * rng.choice([-1.0, 1.0])
            found = differentiator.update(t, np.zeros(3), quaternion)
        assert np.allclose(found[3:], omega, atol=1e-9)
    assert differentiator.update(0.1, np.zeros(3), quaternion) is None


def test_euler_angles_are_pybullets():
    import pybullet

    rng = np.random.default_rng(0)
    quaternions = [q / np.linalg.norm(q) for q in rng.normal(size=(500, 4))]
    half = np.sqrt(0.5)
    quaternions += [np.array(q) for q in ((0, half, 0, half), (0, -half, 0, half), (0.5, 0.5, -0.5, 0.5), (1, 0, 0, 0))]
    for quaternion in quaternions:
        assert np.allclose(euler_angles(quaternion), pybullet.getEulerFromQuaternion(quaternion), atol=1e-9)
