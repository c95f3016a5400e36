"""An arm that answers, for tests without a robot."""

from __future__ import annotations

import numpy as np
import pytest

from drs_core.serving.arm import Arm, read_arm
from drs_core.serving.config import ServingConfig
from drs_core.serving.inputs import Inputs, PoseSample
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.mock_arm import MockArm
from drs_core.serving.observing import TASKS
from drs_core.serving.server import Act, Server
from drs_core.serving.states import Event

GOAL = (0.6, 0.1, 0.2)


def towards_goal(seen, step):
    """A policy that needs no training: half the way to the goal."""
    return np.clip((seen["desired_goal"] - seen["achieved_goal"]) * 10.0, -1.0, 1.0).astype(np.float32)


class Loop:
    """A server, a mock arm and a clock."""

    def __init__(self, act: Act = towards_goal, arm_id: str = "panda", config: ServingConfig | None = None) -> None:
        self.arm: Arm = read_arm(arm_id)
        self.config = config or ServingConfig()
        self.server = Server(self.arm, TASKS["PandaReach-v3"], act, self.config)
        self.robot = MockArm(self.arm, self.arm.neutral_rad, self.config.command_period_s)
        self.kinematics = Kinematics(self.arm)
        self.now_s = 100.0
        self.goal: tuple[float, ...] | np.ndarray = GOAL
        self.published: list[np.ndarray] = []

    def activate(self) -> Loop:
        self.server.tell(Event.CONFIGURE)
        self.server.tell(Event.ACTIVATE)
        return self

    def inputs(self) -> Inputs:
        tip = self.kinematics.tip_position(self.robot.positions)
        down = (1.0, 0.0, 0.0, 0.0)
        frame = self.arm.base_frame
        return Inputs(
            self.robot.joint_states(self.now_s),
            PoseSample(frame, self.goal, down, self.now_s),
            PoseSample(frame, tip, down, self.now_s),
        )

    def move(self) -> int:
        """One policy period of commands; how many were published."""
        count = 0
        for _ in range(self.config.commands_per_period):
            motion = self.server.command(self.now_s)
            if motion is not None:
                count += 1
                self.published.append(motion.positions)
                self.robot.command(motion.positions)
            self.robot.advance(self.config.command_period_s)
            self.now_s += self.config.command_period_s
        return count

    def step(self, inputs: Inputs | None = None):
        verdict = self.server.observe(inputs or self.inputs(), self.now_s)
        self.move()
        return verdict

    def distance(self) -> float:
        return float(np.linalg.norm(self.kinematics.tip_position(self.robot.positions) - np.array(self.goal)))


@pytest.fixture
def loop() -> Loop:
    return Loop().activate()
