"""Small recordings, made without ROS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drs_core.actor import Actor
from drs_core.agent import Agent
from drs_core.recording.definitions import ACTION, ACTION_TYPE, OBSERVATION, OBSERVATION_TYPE
from drs_core.recording.writer import RecordingWriter
from tests.conftest import make_agent

PERIOD_NS = 40_000_000


def serialised(kind: str, definition: str, **fields: object) -> bytes:
    """A message as ROS 2 would send it."""
    from mcap_ros2._dynamic import serialize_dynamic

    return serialize_dynamic(kind, definition)[kind](fields)


def header(number: int) -> dict:
    return {"stamp": {"sec": 100 + number // 25, "nanosec": number % 25 * PERIOD_NS}, "frame_id": ""}


def observation_bytes(agent: Agent, number: int, **changed: object) -> bytes:
    parts = {part.key: part.size for part in agent.pipeline.parts}
    values = np.random.default_rng(number).normal(size=sum(parts.values()))
    fields = {
        "header": header(number),
        "number": number,
        "episode_seed": 0,
        "step": number - 1,
        "environment": agent.environment,
        "keys": list(parts),
        "sizes": list(parts.values()),
        "values": values.tolist(),
        "reward": 0.0,
        "terminated": False,
        "truncated": False,
        "success": -1,
    }
    return serialised(OBSERVATION_TYPE, OBSERVATION, **(fields | changed))


def action_bytes(number: int, values: np.ndarray) -> bytes:
    fields = {"header": header(number), "observation": number, "values": values.tolist()}
    return serialised(ACTION_TYPE, ACTION, **fields)


def actions_of(agent: Agent, count: int) -> np.ndarray:
    parts = {part.key: part.size for part in agent.pipeline.parts}
    actor, actions = Actor(agent), []
    for number in range(1, count + 1):
        values = np.random.default_rng(number).normal(size=sum(parts.values()))
        split = np.split(values, np.cumsum(list(parts.values()))[:-1])
        actions.append(actor.act(dict(zip(parts, split)), number - 1).copy())
    return np.array(actions)


def write(path: Path, agent: Agent, actions: np.ndarray, prefix: str = "", topics: str = "oa") -> Path:
    """Observations 1 to n, each followed by its action."""
    with RecordingWriter(path) as writer:
        if "o" in topics:
            writer.add_topic(f"{prefix}/observation", OBSERVATION_TYPE, OBSERVATION)
        if "a" in topics:
            writer.add_topic(f"{prefix}/action", ACTION_TYPE, ACTION)
        for number, action in enumerate(actions, start=1):
            now_ns = number * PERIOD_NS
            if "o" in topics:
                writer.write(f"{prefix}/observation", observation_bytes(agent, number), now_ns, now_ns)
            if "a" in topics:
                writer.write(f"{prefix}/action", action_bytes(number, action), now_ns, now_ns)
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    agent = make_agent()
    return write(tmp_path / "made.mcap", agent, actions_of(agent, 60))
