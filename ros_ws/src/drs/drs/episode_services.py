"""The simulator's services for tuners: agents, parameter vectors and batches of episodes."""

from __future__ import annotations

from typing import Any

from drs_interfaces.srv import LoadAgent, RunEpisodes, SetParametersVector
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from drs.agent_names import requested_agent
from drs.answering import offer
from drs.conversions import NOT_HELD_S, episode_to_msg, task_from_msg, tasks_from_msg, theta_from
from drs.episode_service import EpisodeService, NotHeldError, agent_from_bytes
from drs_core.errors import UsageError
from drs_core.rollouts.proof import vector_digest

REST_PERIOD_S = 2.0


class EpisodeServices:
    """Wires an EpisodeService to a node."""

    def __init__(self, node: Node, service: EpisodeService, agent: str, agents_root: str) -> None:
        """`agent` is what an empty name in a request means."""
        self._service, self._agent, self._root = service, agent, agents_root
        group = MutuallyExclusiveCallbackGroup()
        offer(node, LoadAgent, "~/load_agent", self._load_agent, group)
        offer(node, SetParametersVector, "~/set_parameters_vector", self._set_parameters_vector, group)
        offer(node, RunEpisodes, "~/run_episodes", self._run_episodes, group)
        # in the group of the services, so that it never meets a batch
        node.create_timer(REST_PERIOD_S, service.rest, group, Clock(clock_type=ClockType.STEADY_TIME))

    def _load_agent(self, request: Any, response: Any) -> None:
        if len(request.content):
            agent = agent_from_bytes(bytes(request.content))
        else:
            _, agent = requested_agent(request.agent, self._agent, self._root)
        self._service.load(agent, request.digest, request.backend or "python")
        response.environment, response.digest = agent.environment, self._service.agent_digest
        response.parameters = len(agent.theta)
        response.message = f"Loaded an agent of {agent.environment} with {len(agent.theta)} parameters."

    def _set_parameters_vector(self, request: Any, response: Any) -> None:
        theta = theta_from(request.theta)
        digest = vector_digest(theta)
        if request.theta_digest and request.theta_digest != digest:
            raise UsageError(
                f"theta's digest is {digest[:16]}…, not {request.theta_digest[:16]}…: it changed on its way."
            )
        self._service.check_length(theta, request.agent_digest)
        if request.test_digest:
            test = task_from_msg(request.test, frozenset(), len(theta)).perturbation
            drawn = vector_digest(theta if test is None else test.candidate(theta))
            if drawn != request.test_digest:
                raise UsageError(
                    f"The test perturbation comes out as {drawn[:16]}… here, not {request.test_digest[:16]}…: "
                    "numpy draws other numbers on this machine. Install the tuner's version of numpy."
                )
        self._service.set_theta(theta, digest)
        response.theta_digest = digest
        response.message = f"theta of {len(theta)} numbers is in force."

    def _run_episodes(self, request: Any, response: Any) -> None:
        response.request_id = request.request_id
        needs = request.agent_digest, request.theta_digest, request.backend
        try:
            self._service.check_held(*needs)
        except NotHeldError:
            response.wall_s = NOT_HELD_S
            raise
        if request.agent_digest and not request.candidates:
            response.message = "All that was asked for is in force."
            return
        tasks = tasks_from_msg(request.candidates, request.measures, self._service.parameters)
        episodes, response.wall_s = self._service.run(tasks, *needs)
        response.episodes = [episode_to_msg(episode) for episode in episodes]
        response.message = f"Ran {len(episodes)} episodes."
