"""What a wild message does to the ROS side: requests, goals, commands, observations and answers of simulators."""

from __future__ import annotations

import array
import importlib
import os
import re
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import rclpy
from drs_interfaces.action import Tune
from drs_interfaces.msg import Action, Candidate, EpisodeResult, Observation
from drs_interfaces.srv import Evaluate, LoadAgent, RunEpisodes, SetParametersVector
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.context import Context
from sensor_msgs.msg import JointState

from drs.agent_names import requested_agent
from drs.arm_conversions import joint_sample, pose_sample
from drs.conversions import action_from, answer_from_msg, observation_from_msg
from drs.episode_service import EpisodeService
from drs.episode_services import EpisodeServices
from drs.state_conversions import joint_targets_from_msg, position_of, tip_targets_from_msg, velocity_of
from drs.tuner_parameters import PARAMETERS, job_from
from drs_core.actor import Actor
from drs_core.episode import DIMENSION
from drs_core.panda import ARM_JOINTS, FINGER_JOINTS
from tests.fuzz import seeds
from tests.fuzz.mutate import NAMES, mutated, safetensors_changed
from tests.fuzz.targets import Target

_WORDS = (
    "panda_reach",
    "x",
    "dimension",
    "motion",
    "trajectory",
    "python",
    "plain",
    "smooth",
    *ARM_JOINTS,
    "observation",
)
_FLOATS = (0.0, 1.0, -1.0, 0.025, 1e30, -1e30, 5e-324, float("nan"), float("inf"), float("-inf"))
_KINDS = {"float": "f", "double": "d", "uint8": "B", "octet": "B"}
_MOST_ITEMS = 6


def wild(kind: type, rng: Random) -> Any:
    """A message of this type with anything in its fields; half of them stay at zero."""
    message = kind()
    for name, field in kind.get_fields_and_field_types().items():
        if rng.random() < 0.6:
            setattr(message, name, _value(field, rng))
    return message


def _value(field: str, rng: Random) -> Any:
    listed = re.fullmatch(r"sequence<(.+?)(?:, \d+)?>", field)
    if listed:
        items = [_value(listed[1], rng) for _ in range(rng.choice((0, 1, 2, 3, rng.randint(0, _MOST_ITEMS))))]
        if listed[1] == "double" or listed[1] == "float":
            return array.array(_KINDS[listed[1]], items)
        return items
    if field == "boolean":
        return rng.random() < 0.5
    if field in ("float", "double"):
        return rng.choice(_FLOATS) if rng.random() < 0.7 else rng.uniform(-2.0, 2.0)
    if field == "string":
        return rng.choice(_WORDS) if rng.random() < 0.6 else rng.choice(NAMES).replace("\0", "")
    number = re.fullmatch(r"(u?)int(\d+)", field)
    if number:
        bits = int(number[2])
        low, high = (0, 2**bits - 1) if number[1] else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return rng.choice((low, high, 0, 1, rng.randint(low, high), min(rng.randint(0, 9), high)))
    package, name = field.split("/")
    return wild(getattr(importlib.import_module(f"{package}.msg"), name), rng)


class Messages(Target):
    """Everything that the nodes do with what others send, without the network between."""

    def __init__(self, folder: Path) -> None:
        """A node with the simulator's services for tuners, and an agent that observes."""
        super().__init__(folder)
        self._agent = seeds.tuned_agent()
        self._content = self._agent.to_bytes()
        (folder / "x.safetensors").write_bytes(self._content)
        self._context = Context()
        rclpy.init(context=self._context, domain_id=int(os.environ.get("ROS_DOMAIN_ID", "0")))
        self._node = rclpy.create_node("fuzzed", context=self._context)
        self._service = EpisodeService()
        self._services = EpisodeServices(self._node, self._service, "", str(folder))
        self._actor = Actor(self._agent)
        self._parameters = {p.name: p.default for p in PARAMETERS} | {"agents_root": str(folder)}
        self._ways: tuple[Callable[[Random], None], ...] = (
            *(self._load_agent, self._set_parameters_vector, self._run_episodes, self._goal, self._evaluate),
            *(self._observation, self._action, self._joints, self._pose, self._twist, self._episode),
        )

    def valid(self) -> None:
        """Each way once, with what it should take."""
        self._services._load_agent(LoadAgent.Request(content=self._content), LoadAgent.Response())
        self._services._load_agent(LoadAgent.Request(agent="x"), LoadAgent.Response())
        theta = array.array("f", self._agent.theta.tobytes())
        self._services._set_parameters_vector(SetParametersVector.Request(theta=theta), SetParametersVector.Response())
        request = RunEpisodes.Request(candidates=[Candidate(episode_seed=1)], measures=["dimension"])
        self._services._run_episodes(request, RunEpisodes.Response())
        job_from(self._parameters, Tune.Goal(agent="panda_reach", output="x"))

    def attempt(self, rng: Random) -> None:
        """One message, one way."""
        rng.choice(self._ways)(rng)

    def close(self) -> None:
        """End the node."""
        self._service.close()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _load_agent(self, rng: Random) -> None:
        request = wild(LoadAgent.Request, rng)
        if rng.random() < 0.5:
            request.content = mutated(self._content, rng, (safetensors_changed, mutated))
        self._services._load_agent(request, LoadAgent.Response())

    def _set_parameters_vector(self, rng: Random) -> None:
        request = wild(SetParametersVector.Request, rng)
        if rng.random() < 0.5:
            request.theta = array.array("f", self._agent.theta.tobytes())
        self._services._set_parameters_vector(request, SetParametersVector.Response())

    def _run_episodes(self, rng: Random) -> None:
        request = wild(RunEpisodes.Request, rng)
        request.candidates = request.candidates[:2]
        self._services._run_episodes(request, RunEpisodes.Response())

    def _goal(self, rng: Random) -> None:
        job_from(self._parameters, wild(Tune.Goal, rng))

    def _evaluate(self, rng: Random) -> None:
        requested_agent(wild(Evaluate.Request, rng).agent, "panda_reach", str(self.folder))

    def _observation(self, rng: Random) -> None:
        message = wild(Observation, rng)
        if rng.random() < 0.5:
            message.keys, message.sizes = ["observation"], array.array("I", [2])
            message.values = array.array("d", [rng.choice(_FLOATS), rng.uniform(-1.0, 1.0)])
        action = self._actor.act(observation_from_msg(message), message.step)
        assert np.isfinite(action).all()

    def _action(self, rng: Random) -> None:
        action = action_from(wild(Action, rng).values, self._agent.low, self._agent.high)
        assert np.isfinite(action).all()

    def _joints(self, rng: Random) -> None:
        message = wild(JointState, rng)
        if rng.random() < 0.5:
            message.name = list(ARM_JOINTS + FINGER_JOINTS)[: rng.randint(6, 9)]
            message.position = array.array("d", [rng.choice(_FLOATS) for _ in message.name])
        joint_sample(message)
        assert np.isfinite(joint_targets_from_msg(message, np.zeros(2))).all()

    def _pose(self, rng: Random) -> None:
        message = wild(PoseStamped, rng)
        pose_sample(message)
        assert np.isfinite(position_of(message)).all()
        assert np.isfinite(tip_targets_from_msg(message, np.zeros(2))).all()

    def _twist(self, rng: Random) -> None:
        assert np.isfinite(velocity_of(wild(TwistStamped, rng))).all()

    def _episode(self, rng: Random) -> None:
        answer_from_msg(wild(EpisodeResult, rng), rng.choice(([], [DIMENSION])))
