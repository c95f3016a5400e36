"""Wild messages over the network: nodes go on, say what is wrong, and give the results that they would give anyway."""

from __future__ import annotations

import math
from pathlib import Path
from random import Random
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from drs_interfaces.msg import Action, Observation
from drs_interfaces.srv import LoadAgent, Reset, RunEpisodes, SetParametersVector, Step
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from drs.answering import SERVICE_DEPTH
from drs_core.objective import Objective
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from tests.conftest import make_agent
from tests.fuzz.wild_messages import wild
from tests.ros.fake_simulator import fake, refusals
from tests.ros.graph import Graph
from tests.ros.test_rollouts import done, same, simulators
from tests.test_tuning import tune

REQUESTS = 150


def test_wild_requests_and_commands_are_answered_with_sentences(graph: Graph) -> None:
    simulator = graph.start_ready("simulator_node", environment="PandaReach-v3", real_time_factor=0.0)
    policy = graph.start_ready("policy_node", autostart=True)
    topics = {
        "action": Action,
        "observation": Observation,
        "joint_states": JointState,
        "end_effector/pose": PoseStamped,
    }
    publishers = [(graph.client.create_publisher(kind, name, 10), kind) for name, kind in topics.items()]
    services = {"load_agent": LoadAgent, "set_parameters_vector": SetParametersVector, "reset": Reset, "step": Step}
    services |= {"run_episodes": RunEpisodes}
    clients = {
        name: graph.client.create_client(kind, f"simulator_node/{name}", qos_profile=SERVICE_DEPTH)
        for name, kind in services.items()
    }
    graph.wait(lambda: all(client.service_is_ready() for client in clients.values()), "the services")
    graph.become_known("simulator_node")
    rng, messages = Random(0), []
    for number in range(REQUESTS):
        for publisher, kind in publishers:
            publisher.publish(wild(kind, rng))
        name = list(services)[number % len(services)]
        answer = graph.finish(clients[name].call_async(wild(services[name].Request, rng)), name)
        messages.append("" if answer.success else answer.message)
        assert answer.success or answer.message
    assert not [message for message in messages if "failed inside the node" in message]
    assert sum(map(bool, messages)) > REQUESTS // 4
    # both still do what they are for
    assert graph.call(Reset, "simulator_node/reset", Reset.Request(seed=3)).success
    answered: list[Action] = []
    graph.client.create_subscription(Action, "action", answered.append, 10)
    graph.wait(lambda: len([a for a in answered if len(a.values) == 3]) > 5, "actions")
    for node in (simulator, policy):
        assert node.process.poll() is None and not node.said("Traceback")


@pytest.mark.parametrize("executable", ["simulator_node", "tuner_node", "policy_node", "mock_arm_node"])
def test_what_ros_itself_cannot_take_is_passed_over(graph: Graph, executable: str) -> None:
    node = graph.start_ready(executable, use_sim_time=executable != "simulator_node")
    wild_value = Parameter(name="agent", value=ParameterValue(type=200))
    client = graph.client.create_client(SetParameters, f"{executable}/set_parameters")
    graph.wait(client.service_is_ready, "set_parameters")
    client.call_async(SetParameters.Request(parameters=[wild_value]))

    def lives_and_says(words: str) -> bool:
        # what a callback raises comes out with the next one
        names = graph.call(ListParameters, f"{executable}/list_parameters", repeat_s=2.0).result.names
        return bool(names) and node.said(words)

    graph.wait(lambda: lives_and_says("200 is not a valid"), "the sentence")
    if executable != "simulator_node":
        clock = graph.client.create_publisher(Clock, "/clock", 10)

        def refused() -> bool:
            clock.publish(Clock(clock=Time(sec=-1)))
            return lives_and_says("must not be negative")

        graph.wait(refused, "the other sentence")
    assert node.process.poll() is None and not node.said("Traceback")


DIMENSION = {"has_dimension": True, "dimension_lower": 1.0, "dimension_upper": 1.0, "dimension_limit": 3.0}
LIES: dict[str, dict[str, Any]] = {
    "a return that is not finite": {"return_sum": math.nan},
    "a return beyond all rewards": {"return_sum": 1e300},
    "a dimension limit that is not a number": DIMENSION | {"dimension_limit": math.nan},
    "a dimension limit of 0": DIMENSION | {"dimension_limit": 0.0},
    "a dimension bound that is not finite": DIMENSION | {"dimension_upper": math.inf},
    "half a position": {"tip_position": [1.0], "tip_velocity": [1.0]},
}


@pytest.mark.parametrize("lie", LIES.values(), ids=LIES)
def test_a_simulator_that_answers_nonsense_takes_no_part(graph: Graph, tmp_path: Path, lie: dict[str, Any]) -> None:
    agent, path = make_agent(), tmp_path / "begin.safetensors"
    agent.save(path)
    search = SearchConfig(updates=2, directions=2, alpha=(0.3, 0.1), sigma=(0.3, 0.1), seed=5)
    objective = "dimension" if "has_dimension" in lie else "return"
    config = TuneConfig(search, Objective(objective), evaluate_every=0)
    expected = tune(agent, tmp_path / "expected", config=config)

    def lying(_: Any, response: RunEpisodes.Response) -> None:
        for episode in response.episodes:
            for name, value in lie.items():
                setattr(episode, name, value)

    asked = fake(graph, "liar", lying)
    settings = {
        "agent": path,
        "output": tmp_path / "run",
        "updates": 2,
        "directions": 2,
        "seed": 5,
        "objective": objective,
        "evaluate_every": 0,
    }
    schedule = {"alpha": [0.3, 0.1], "sigma": [0.3, 0.1]}
    node = graph.start("tuner_node", autostart=True, exit_when_done=True, **settings, **schedule)
    graph.wait(lambda: bool(asked), "a first question to the liar")
    simulators(graph, 1)
    graph.wait(lambda: done(node), "the end of tuning")
    assert node.process.returncode == 0, node.log.read_text()
    (refusal,) = {line.split(" [")[0] for line in refusals(node.log.read_text(), "liar")}
    assert refusal == "[WARN]" and not node.said("Traceback")
    assert same(tmp_path / "run", expected)
