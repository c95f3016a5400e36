"""A simulator in the test's own process that takes every agent and theta, and answers what the test says."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from drs_interfaces.msg import EpisodeResult
from drs_interfaces.srv import LoadAgent, RunEpisodes, SetParametersVector

from drs.answering import SERVICE_DEPTH
from tests.ros.graph import Graph

Changes = Callable[[RunEpisodes.Request, RunEpisodes.Response], None]
"""Changes an answer of whole, if made up, episodes."""


def fake(graph: Graph, name: str, changes: Changes) -> list[RunEpisodes.Request]:
    """Offer its services, served while the graph waits; what it is asked to run."""
    asked: list[RunEpisodes.Request] = []

    def agree(request: Any, response: Any) -> Any:
        response.success = True
        return response

    def answer(request: RunEpisodes.Request, response: RunEpisodes.Response) -> RunEpisodes.Response:
        asked.append(request)
        response.success, response.request_id, response.wall_s = True, request.request_id, math.nan
        response.episodes = [EpisodeResult(seed=c.episode_seed, length=50) for c in request.candidates]
        changes(request, response)
        return response

    for kind, service, call in (
        (LoadAgent, "load_agent", agree),
        (SetParametersVector, "set_parameters_vector", agree),
        (RunEpisodes, "run_episodes", answer),
    ):
        graph.client.create_service(kind, f"{name}/{service}", call, qos_profile=SERVICE_DEPTH)
    return asked


def refusals(log: str, name: str) -> list[str]:
    """Lines of a tuner's log that say that this simulator cannot take part."""
    return [line for line in log.splitlines() if f"{name} cannot take part: " in line]
