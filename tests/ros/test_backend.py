"""Simulators run the backend that the tuner asks for, or take no part: a search is never mixed."""

from __future__ import annotations

import array
import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from drs_interfaces.msg import Candidate
from drs_interfaces.srv import LoadAgent, RunEpisodes

from drs_core.accelerator.library import Unavailable, helper
from drs_core.agent import load
from drs_core.rollouts import InProcess, Task
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Tuning
from tests.conftest import make_agent
from tests.ros.graph import Graph
from tests.ros.test_rollouts import Silent, done, simulators

HOPPER = "HopperBulletEnv-v0"
LOAD, RUN = "simulator_node/load_agent", "simulator_node/run_episodes"


@pytest.fixture(scope="module", autouse=True)
def built() -> None:
    try:
        helper()
    except Unavailable as reason:
        pytest.skip(f"the accelerator: {reason}")


def test_a_simulator_runs_what_is_asked_for_or_refuses(graph: Graph) -> None:
    agent = make_agent(HOPPER)
    content = array.array("B", agent.to_bytes())
    graph.start_ready("simulator_node", stream=False)
    for backend in ("compiled", "python", "", "compiled"):
        answer = graph.call(LoadAgent, LOAD, LoadAgent.Request(content=content, backend=backend), repeat_s=10.0)
        assert answer.success, answer.message
        in_force = backend or "python"
        with closing(InProcess(agent, in_force)) as rollouts:
            [expected] = rollouts.run(agent.theta, [Task(3)])
        request = RunEpisodes.Request(candidates=[Candidate(episode_seed=3)], backend=in_force)
        answer = graph.call(RunEpisodes, RUN, request)
        assert answer.success and answer.episodes[0].return_sum == expected.return_, answer.message
    request.backend = "python"
    answer = graph.call(RunEpisodes, RUN, request)
    assert not answer.success and "call load_agent first" in answer.message
    for refused, words in (
        (LoadAgent.Request(content=content, backend="fast"), "allowed are python, plain, compiled"),
        (LoadAgent.Request(agent="panda_reach", backend="compiled"), "cannot run here"),
    ):
        answer = graph.call(LoadAgent, LOAD, refused)
        assert not answer.success and words in answer.message
    request.backend = "compiled"
    assert graph.call(RunEpisodes, RUN, request).success, "the agent before stays"


def test_tuning_over_simulators_is_the_compiled_one(graph: Graph, tmp_path: Path) -> None:
    agent = make_agent(HOPPER)
    agent.save(tmp_path / "hopper.safetensors")
    config = TuneConfig(SearchConfig(updates=2, directions=6, seed=5), evaluate_every=0, backend="compiled")
    with closing(InProcess(agent, "compiled")) as rollouts:
        expected = Tuning(agent, "hopper", config, tmp_path / "expected").run(rollouts, Silent())
    simulators(graph, 2)
    node = graph.start(
        "tuner_node", agent=tmp_path / "hopper.safetensors", updates=2, directions=6, seed=5, evaluate_every=0,
        backend="compiled", autostart=True, exit_when_done=True, output=tmp_path / "run",
    )  # fmt: skip
    graph.wait(lambda: done(node), "the end of tuning")
    assert node.process.returncode == 0
    assert np.array_equal(load(tmp_path / "run" / "agent.safetensors").theta, expected.theta)
    assert json.loads((tmp_path / "run" / "run.json").read_text())["config"]["backend"] == "compiled"


def test_a_simulator_that_cannot_takes_no_part(graph: Graph, tmp_path: Path) -> None:
    simulators(graph, 1)
    node = graph.start("tuner_node", backend="compiled", autostart=True, directions=1, updates=1, output=tmp_path / "r")
    graph.wait(lambda: node.said("cannot take part: The backend compiled cannot run here"), "the refusal")
    assert not (tmp_path / "r" / "agent.safetensors").exists()
