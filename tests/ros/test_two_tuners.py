"""Two tuners that find the same simulator use it in turn; each run comes out as if it were alone."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path

from drs_interfaces.msg import Candidate
from drs_interfaces.srv import LoadAgent, RunEpisodes

from drs_core.agent import load
from drs_core.importing import resolve
from drs_core.rollouts import InProcess
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning
from tests.ros.arm_of_episodes import agent_in, ended
from tests.ros.fake_simulator import fake, refusals
from tests.ros.graph import Graph
from tests.ros.test_rollouts import Silent, same, simulators

SETTINGS = {"updates": 4, "directions": 32, "evaluate_every": 0, "evaluation_episodes": 1}
TOLD = "holds another agent or theta than it was sent"


def test_two_runs_of_one_agent_and_one_of_another_share_a_simulator(graph: Graph, tmp_path: Path) -> None:
    _, begin = agent_in(tmp_path)
    simulators(graph, 1)
    runs = [(str(begin), 5), (str(begin), 6), ("panda_reach", 7)]
    nodes = [
        graph.start(
            "tuner_node", f"tuner_{seed}", agent=agent, seed=seed, output=tmp_path / f"run_{seed}",
            autostart=True, exit_when_done=True, **SETTINGS,
        )
        for agent, seed in runs
    ]  # fmt: skip
    for node in nodes:
        ended(graph, node)
        assert node.process.returncode == 0, node.log.read_text()
        assert not refusals(node.log.read_text(), "simulator_0")
    assert any(node.said(TOLD) for node in nodes), "they met"
    for name, seed in runs:
        agent = resolve(name) if name == "panda_reach" else load(begin)
        tuning = Tuning(agent, name, tune_config(SETTINGS | {"seed": seed}), tmp_path / f"alone_{seed}")
        with closing(InProcess(agent)) as rollouts:
            alone = tuning.run(rollouts, Silent())
        assert same(tmp_path / f"run_{seed}", alone), name


def test_being_told_of_something_else_is_no_failure_however_often(graph: Graph, tmp_path: Path) -> None:
    _, begin = agent_in(tmp_path)
    times = 5

    def holds_another(request: RunEpisodes.Request, response: RunEpisodes.Response) -> None:
        if len(asked) <= times:
            response.success, response.wall_s = False, -1.0

    asked = fake(graph, "shared", holds_another)
    settings = SETTINGS | {"updates": 1, "directions": 1}
    node = graph.start(
        "tuner_node", agent=begin, output=tmp_path / "run", autostart=True, exit_when_done=True, **settings
    )
    ended(graph, node)
    log = node.log.read_text()
    assert node.process.returncode == 0, log
    assert log.count(TOLD) == 1 and not refusals(log, "shared")
    assert len(asked) > times


def test_a_simulator_says_whether_it_holds_what_a_request_needs(graph: Graph) -> None:
    simulators(graph, 1)
    run, digest = "simulator_0/run_episodes", resolve("panda_reach").digest()
    ask = lambda **fields: graph.call(RunEpisodes, run, RunEpisodes.Request(agent_digest=digest, **fields))  # noqa: E731
    answer = ask()
    assert not answer.success and answer.wall_s < 0.0 and "No agent is loaded" in answer.message
    assert graph.call(LoadAgent, "simulator_0/load_agent", LoadAgent.Request(agent="panda_reach")).success
    for other in ({"theta_digest": "00"}, {"backend": "compiled"}):
        answer = ask(**other)
        assert not answer.success and answer.wall_s < 0.0, other
    answer = ask(candidates=[Candidate(sign=1, sigma=math.nan)])
    assert not answer.success and answer.wall_s == 0.0
    answer = ask()
    assert answer.success and not answer.episodes
