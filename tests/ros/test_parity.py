"""An episode over topics, simulator_node <-> policy_node, equals the episode in one process."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drs_interfaces.msg import Observation
from drs_interfaces.srv import Reset
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from drs_core.agent import Agent
from drs_core.environments import Environment
from drs_core.importing import resolve
from tests.conftest import make_agent
from tests.ros.graph import Graph

SEED = 7


def in_process(agent: Agent, seed: int) -> tuple[list[np.ndarray], float]:
    """Every observation of the episode, flat, and its return."""
    with closing(Environment(agent.environment)) as environment:
        policy, assembler = agent.policy(), agent.assembler()
        observation, flat, total, step, done = environment.reset(seed), [], 0.0, 0, False
        while True:
            parts = (
                [observation[key] for key in environment.spaces.parts]
                if isinstance(observation, dict)
                else [observation]
            )
            flat.append(np.concatenate(parts).astype(np.float64))
            if done:
                return flat, total
            action = policy.act(assembler.features(observation, step))
            observation, reward, terminated, truncated, _ = environment.step(action)
            total, step, done = total + reward, step + 1, terminated or truncated


def over_topics(graph: Graph, agent: str, interface: str, source: str = "observation") -> list[Observation]:
    seen: dict[int, Any] = {}
    graph.client.create_subscription(Observation, "observation", lambda m: seen.setdefault(m.number, m), 1000)
    graph.start_ready(
        "simulator_node", agent=agent, synchronous=True, real_time_factor=0.0, command_interface=interface
    )
    graph.start_ready("policy_node", agent=agent, input=source)
    for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request(transition=Transition(id=transition))
        assert graph.call(ChangeState, "policy_node/change_state", request).success
    first = graph.call(Reset, "simulator_node/reset", Reset.Request(seed=SEED)).observation.number

    def ended() -> bool:
        return any(m.number > first and (m.terminated or m.truncated) for m in seen.values())

    graph.wait(ended, "the end of the episode")
    last = min(m.number for m in seen.values() if m.number > first and (m.terminated or m.truncated))
    assert all(number in seen for number in range(first, last + 1)), "an observation was lost"
    return [seen[number] for number in range(first, last + 1)]


@pytest.mark.parametrize("name", ["panda_reach", "a2c/HopperBulletEnv-v0_1", "a2c/LunarLanderContinuous-v2_1"])
def test_through_actions_it_is_equal_bit_for_bit(graph: Graph, request: pytest.FixtureRequest, name: str) -> None:
    if "/" in name:
        name = str(request.getfixturevalue("shared") / "agents" / name)
    expected, total = in_process(resolve(name), SEED)
    messages = over_topics(graph, name, "action")
    assert len(messages) == len(expected)
    assert all(np.array_equal(np.array(m.values), e) for m, e in zip(messages, expected))
    assert sum(m.reward for m in messages) == total
    assert {m.episode_seed for m in messages} == {SEED}


@pytest.mark.parametrize("interface", ["joint_command", "target_pose"])
def test_through_arm_commands_the_tip_is_within_a_micrometre(graph: Graph, interface: str) -> None:
    expected, _ = in_process(resolve("panda_reach"), SEED)
    messages = over_topics(graph, "panda_reach", interface)
    place = 6  # achieved_goal and desired_goal come first, then the tip's position
    distance = [
        np.abs(np.array(m.values)[place : place + 3] - e[place : place + 3]).max() for m, e in zip(messages, expected)
    ]
    print(f"{interface}: largest distance of the tip {max(distance):.2e} m")
    assert len(messages) == len(expected)
    assert max(distance) < 1e-6


def test_fingers_and_arm_are_commanded_together(graph: Graph, tmp_path: Path) -> None:
    agent = make_agent("PandaPickAndPlace-v3", (32,), 6)  # its gripper opens and closes
    agent.save(tmp_path / "agent.safetensors")
    expected, _ = in_process(agent, SEED)
    messages = over_topics(graph, str(tmp_path / "agent.safetensors"), "joint_command")
    assert len(messages) == len(expected)
    difference = max(np.abs(np.array(m.values) - e).max() for m, e in zip(messages, expected))
    width = np.array(expected)[:, 12]
    print(f"gripper {width.min():.3f} to {width.max():.3f} m, largest difference {difference:.2e}")
    assert np.ptp(width) > 0.02
    assert difference < 1e-6


def test_from_an_arms_measurements_alone_the_goal_is_reached(graph: Graph) -> None:
    # not compared bit for bit: a new goal may be known only after the first pose of its episode
    messages = over_topics(graph, "panda_reach", "joint_command", source="state")
    assert messages[-1].success == Observation.SUCCESS_YES
