"""simulator_node: its services, its wrong requests, its topics, and what it costs."""

from __future__ import annotations

import array
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from drs_interfaces.msg import Candidate
from drs_interfaces.srv import LoadAgent, Reset, RunEpisodes, SetParametersVector, Step
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path as Trace
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from drs.qos import LATCHED
from drs_core.environments import Environment
from drs_core.importing import resolve
from drs_core.rollouts import InProcess, Task
from drs_core.search import Perturbation
from tests.ros.graph import Graph

THETA = resolve("panda_reach").theta


def floats(values: np.ndarray) -> array.array:
    return array.array("f", values.astype(np.float32).tobytes())


def test_it_is_ready_soon_and_small_and_without_torch(graph: Graph) -> None:
    times = []
    for name in ("first", "second", "third"):
        start = time.monotonic()
        node = graph.start_ready("simulator_node", name, agent="panda_reach")
        times.append(time.monotonic() - start)
    took, memory = min(times), node.memory_mb
    loaded = Path(f"/proc/{node.process.pid}/maps").read_text()
    print(f"ready in {took:.2f} s, {memory:.0f} MB")
    assert "/torch/" not in loaded and "/scipy/" not in loaded
    assert memory < 150
    assert took < 1.5


def test_a_simulator_that_nobody_needs_costs_nothing(graph: Graph) -> None:
    node = graph.start_ready("simulator_node", agent="panda_reach")
    idle = node.memory_mb
    shown: list[JointState] = []
    graph.client.create_subscription(JointState, "joint_states", shown.append, 10)
    graph.wait(lambda: len(shown) > 3, "the topics to begin")
    streaming = node.memory_mb
    assert graph.call(LoadAgent, "simulator_node/load_agent").success
    answer = graph.call(RunEpisodes, "simulator_node/run_episodes", RunEpisodes.Request(candidates=[Candidate()] * 9))
    assert answer.success, answer.message
    both = node.memory_mb
    print(f"idle {idle:.0f} MB, streaming {streaming:.0f} MB, with episodes {both:.0f} MB")
    assert idle + 30 < streaming < 150
    graph.wait(lambda: node.memory_mb < streaming + 10 < both, "the episodes' simulator to go")
    again = graph.call(RunEpisodes, "simulator_node/run_episodes", RunEpisodes.Request(candidates=[Candidate()] * 9))
    assert again.success and again.episodes == answer.episodes


def test_no_module_of_a_simulator_imports_torch() -> None:
    code = (
        "import sys, drs.simulator_node; from drs_core.environments import Environment; "
        "Environment('PandaReach-v3'); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL).returncode == 0


def test_reset_and_step_are_those_of_the_environment(graph: Graph) -> None:
    graph.start_ready("simulator_node")
    environment = Environment("PandaReach-v3")
    observation = environment.reset(11)
    answer = graph.call(Reset, "simulator_node/reset", Reset.Request(seed=11, stepped=True))
    action = np.array([0.5, -1.0, 0.25], np.float32)
    for _ in range(50):
        flat = np.concatenate([observation[key] for key in answer.observation.keys])
        assert np.array_equal(np.array(answer.observation.values), flat)
        observation, reward, *_ = environment.step(action)
        answer = graph.call(Step, "simulator_node/step", Step.Request(action=floats(action)))
        assert answer.success and answer.observation.reward == reward
    assert answer.observation.truncated
    answer = graph.call(Step, "simulator_node/step", Step.Request(action=floats(action)))
    assert not answer.success and "call reset" in answer.message
    environment.close()


def test_episodes_are_those_of_the_library(graph: Graph) -> None:
    graph.start_ready("simulator_node", agent="panda_reach")
    assert graph.call(LoadAgent, "simulator_node/load_agent").success
    measures = ["dimension", "motion", "trajectory"]
    scope = resolve("panda_reach").network.scope(action_gains=True)
    candidates = [
        Candidate(episode_seed=3),
        Candidate(episode_seed=3, run_seed=9, update=2, direction=5, sign=-1, sigma=0.01),
        Candidate(episode_seed=3, run_seed=9, update=2, direction=5, sign=1, sigma=0.2, start=scope.start, gains=3),
    ]
    answer = graph.call(
        RunEpisodes,
        "simulator_node/run_episodes",
        RunEpisodes.Request(candidates=candidates, measures=measures, request_id=42),
    )
    assert answer.success and answer.request_id == 42, answer.message
    asked = (None, Perturbation(9, 2, 5, -1, 0.01), Perturbation(9, 2, 5, 1, 0.2, scope))
    tasks = [Task(3, frozenset(measures), p) for p in asked]
    rollouts = InProcess(resolve("panda_reach"))
    for result, episode in zip(answer.episodes, rollouts.run(THETA, tasks)):
        assert (result.return_sum, result.length, result.action_change) == (
            episode.return_, episode.length, episode.action_change,
        )  # fmt: skip
        assert (result.dimension_lower, result.dimension_upper) == (episode.dimension.lower, episode.dimension.upper)
        assert result.tip_jerk_mean_square == episode.motion.jerk_mean_square
        assert np.array_equal(np.array(result.tip_position, np.float32), episode.tip_position.ravel())
    rollouts.close()


def test_an_agent_that_is_loaded_again_has_its_own_theta_again(graph: Graph) -> None:
    graph.start_ready("simulator_node", stream=False)

    def load() -> LoadAgent.Response:
        return graph.call(LoadAgent, "simulator_node/load_agent", LoadAgent.Request(agent="panda_reach"))

    def run() -> float:
        (episode,) = graph.call(
            RunEpisodes, "simulator_node/run_episodes", RunEpisodes.Request(candidates=[Candidate(episode_seed=3)])
        ).episodes
        return episode.return_sum

    assert load().success
    own, other = run(), SetParametersVector.Request(theta=floats(-THETA))
    assert graph.call(SetParametersVector, "simulator_node/set_parameters_vector", other).success
    assert run() != own
    assert load().success
    assert run() == own


def test_wrong_requests_are_answered_with_a_sentence(graph: Graph) -> None:
    graph.start_ready("simulator_node")
    one = [Candidate(episode_seed=1)]
    run, load = "simulator_node/run_episodes", "simulator_node/load_agent"
    vector, Vector = "simulator_node/set_parameters_vector", SetParametersVector.Request
    requests = [
        (RunEpisodes, run, RunEpisodes.Request(candidates=one), "No agent is loaded"),
        (LoadAgent, load, LoadAgent.Request(), "No agent is named"),
        (LoadAgent, load, LoadAgent.Request(agent="nobody"), "There is no agent 'nobody'"),
        (LoadAgent, load, LoadAgent.Request(agent="../panda_reach"), "not a plain name"),
        (LoadAgent, load, LoadAgent.Request(content=array.array("B", b"nonsense")), "not an agent file"),
        (LoadAgent, load, LoadAgent.Request(agent="panda_reach", digest="00"), "digest"),
        (LoadAgent, load, LoadAgent.Request(agent="panda_reach"), None),
        (SetParametersVector, vector, Vector(theta=floats(THETA * np.nan)), "not finite"),
        (SetParametersVector, vector, Vector(theta=floats(THETA[1:])), "theta has"),
        (SetParametersVector, vector, Vector(theta=floats(THETA), agent_digest="00"), "call load_agent"),
        (SetParametersVector, vector, Vector(theta=floats(THETA), theta_digest="00"), "changed on its way"),
        (SetParametersVector, vector,
         Vector(theta=floats(THETA), test=Candidate(sign=1, sigma=0.1), test_digest="00"), "numpy"),
        (RunEpisodes, run, RunEpisodes.Request(), "0 candidates"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=one * 4097), "4097 candidates"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=one, agent_digest="00"), "call load_agent"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=one, theta_digest="00"), "set_parameters_vector"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=one, measures=["mass"]), "'mass' is unknown"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=[Candidate(sign=3)]), "sign is 3"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=[Candidate(sign=1, sigma=float("nan"))]), "sigma is nan"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=[Candidate(sign=1, start=10**9)]), "start is 1000000000"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=[Candidate(sign=1, gains=10**9)]), "1000000000 gains"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=[Candidate(episode_seed=2**64 - 1)]), "seed is"),
        (Step, "simulator_node/step", Step.Request(), "call reset with stepped"),
        (Reset, "simulator_node/reset", Reset.Request(seed=2**64 - 1), "seed is"),
        (Reset, "simulator_node/reset", Reset.Request(stepped=True), None),
        (Step, "simulator_node/step", Step.Request(action=floats(np.zeros(2))), "takes 3"),
        (Step, "simulator_node/step", Step.Request(action=floats(np.full(3, np.nan))), "not finite"),
        (RunEpisodes, run, RunEpisodes.Request(candidates=one), None),
    ]  # fmt: skip
    for kind, name, request, words in requests:
        answer = graph.call(kind, name, request)
        assert answer.success == (words is None), (name, answer.message)
        assert words is None or words in answer.message, (words, answer.message)


def test_an_unknown_environment_ends_the_node_with_a_sentence(graph: Graph) -> None:
    node = graph.start("simulator_node", environment="NoSuch-v0")
    assert node.process.wait(timeout=20) == 2
    assert node.said("There is no environment 'NoSuch-v0'") and not node.said("Traceback")


def test_an_agent_of_another_environment_is_refused(graph: Graph) -> None:
    graph.start_ready("simulator_node", environment="MountainCarContinuous-v0")
    answer = graph.call(LoadAgent, "simulator_node/load_agent", LoadAgent.Request(agent="panda_reach"))
    assert not answer.success and "MountainCarContinuous-v0 only" in answer.message


def test_the_topics_show_the_robot_at_its_own_rate(graph: Graph) -> None:
    seen: dict[str, list] = {}
    for kind, topic, qos in (
        (JointState, "joint_states", 10), (PoseStamped, "end_effector/pose", 10), (Clock, "/clock", 10),
        (TwistStamped, "end_effector/twist", 10), (Trace, "end_effector/trace", LATCHED),
        (PoseStamped, "goal_pose", LATCHED),
    ):  # fmt: skip
        seen[topic] = []
        graph.client.create_subscription(kind, topic, seen[topic].append, qos)
    graph.start_ready("simulator_node")
    graph.wait(lambda: all(seen.values()) and len(seen["/clock"]) > 30, "every topic")
    assert seen["joint_states"][0].name[:7] == [f"panda_joint{i}" for i in range(1, 8)]
    first, last = (m.clock.sec + 1e-9 * m.clock.nanosec for m in (seen["/clock"][0], seen["/clock"][-1]))
    assert (last - first) / (len(seen["/clock"]) - 1) == pytest.approx(0.04, rel=1e-3)
    assert seen["end_effector/pose"][0].header.frame_id == "panda_link0"
