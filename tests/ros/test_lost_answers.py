"""A tuner goes on where answers to its requests get lost, as on networks that lose packets."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from rclpy.service import Service

from drs.dispatch import is_due
from tests.ros.arm_of_episodes import CONFIG, Arm, agent_in, ended, offer, tuner
from tests.ros.graph import Graph
from tests.ros.test_rollouts import same
from tests.test_tuning import tune

LOST = 2


def test_a_simulator_whose_first_answers_are_lost_is_asked_again(graph: Graph, tmp_path: Path) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    offer(graph, Arm())
    asked = Counter[str]()
    for service in graph.client.services:
        if service.srv_name.endswith(("/load_agent", "/set_parameters_vector")):
            lose_first_answers(service, asked)
    # the tuner's patience for one answer is 30 s
    node = tuner(graph, begin, tmp_path / "run")
    ended(graph, node, patience_s=25.0)
    assert node.process.returncode == 0, node.log.read_text()
    assert same(tmp_path / "run", expected)
    assert len(asked) == 2 and min(asked.values()) > LOST


def lose_first_answers(service: Service, asked: Counter[str]) -> None:
    send = service.send_response

    def send_some(response: Any, header: Any) -> None:
        asked[service.srv_name] += 1
        if asked[service.srv_name] > LOST:
            send(response, header)

    service.send_response = send_some


def test_a_request_is_repeated_ever_more_rarely() -> None:
    assert is_due([])
    assert not is_due([0.9]) and is_due([1.1])
    assert not is_due([2.9, 1.9]) and is_due([3.2, 2.1])
    assert is_due([7.5, 6.4, 4.1]) and not is_due([7.5, 6.4, 3.9])
