"""A tuner goes on where answers to its requests get lost, as on networks that lose packets."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rclpy.service import Service

from drs.dispatch import SILENT_S, is_due
from drs_core.rollouts import Task
from tests.ros.arm_of_episodes import CONFIG, Arm, agent_in, ended, offer, tuner
from tests.ros.graph import Graph
from tests.ros.test_rollouts import same
from tests.test_broken_off import plus
from tests.test_tuning import tune

Loses = Callable[[list[int]], bool]
"""The numbers that its client gave to each request so far, this one included -> whether the answer is lost."""


def first_two_answers(numbers: list[int]) -> bool:
    return len(numbers) <= 2


def every_answer_to_the_first_client(numbers: list[int]) -> bool:
    """A simulator that is never told of this end of the tuner's; a new client counts from the beginning again."""
    return numbers == sorted(set(numbers))


@pytest.mark.parametrize("loses", [first_two_answers, every_answer_to_the_first_client])
def test_a_simulator_whose_answers_are_lost_takes_part(graph: Graph, tmp_path: Path, loses: Loses) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    offer(graph, Arm())
    services = [s for s in graph.client.services if s.srv_name.endswith(("/load_agent", "/set_parameters_vector"))]
    lost = [lose(service, loses) for service in services]
    node = tuner(graph, begin, tmp_path / "run", call_deadline_s=300.0)
    ended(graph, node)
    assert node.process.returncode == 0, node.log.read_text()
    assert same(tmp_path / "run", expected)
    assert [len(answers) >= 2 for answers in lost] == [True, True]


def test_an_episode_may_be_long(graph: Graph, tmp_path: Path) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)

    def slow(task: Task, run: int) -> bool:
        if plus(task, 1) and task.perturbation.update == 1:
            time.sleep(3.0 * SILENT_S)
        return False

    arm = offer(graph, Arm(slow))
    node = tuner(graph, begin, tmp_path / "run")
    ended(graph, node)
    assert node.process.returncode == 0, node.log.read_text()
    assert same(tmp_path / "run", expected)
    # its answer came: nothing was run twice
    assert {times for task, times in arm.runs.items() if task.perturbation} == {1}


def lose(service: Service, loses: Loses) -> list[Any]:
    """Make a service lose answers; those lost."""
    send, numbers, lost = service.send_response, list[int](), list[Any]()

    def send_some(response: Any, header: Any) -> None:
        numbers.append(header.request_id.sequence_number)
        if loses(numbers):
            lost.append(response)
        else:
            send(response, header)

    service.send_response = send_some
    return lost


def test_a_request_is_repeated_ever_more_rarely() -> None:
    assert is_due([])
    assert not is_due([0.9]) and is_due([1.1])
    assert not is_due([2.9, 1.9]) and is_due([3.2, 2.1])
    assert is_due([7.5, 6.4, 4.1]) and not is_due([7.5, 6.4, 3.9])
