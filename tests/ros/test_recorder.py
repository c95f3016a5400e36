"""The graph's topics in an MCAP file: written while nodes come and go, read by another program, replayed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drs_interfaces.msg import Action, Observation
from lifecycle_msgs.msg import Transition
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader

from drs_core.recording.reader import RecordingReader, contents
from tests.conftest import drs
from tests.ros.graph import Graph
from tests.ros.test_arm import PATIENT, Watched
from tests.ros.test_policy import change

DRS = [sys.executable, "-m", "drs_core.cli", "record"]


def record(graph: Graph, path: Path, *more: str) -> subprocess.Popen[str]:
    # by itself, without the workspace having been sourced, as from a fresh terminal
    environment = {k: v for k, v in graph.environment.items() if k not in ("AMENT_PREFIX_PATH", "PYTHONPATH")}
    with open(path.with_suffix(".log"), "w") as log:
        return subprocess.Popen(
            [*DRS, "-o", path, "--json", *more], stdout=subprocess.PIPE, stderr=log, text=True, env=environment
        )


def counted(path: Path) -> dict[str, int]:
    return {topic.name: count for topic, count in contents(path).counts.items()} if path.exists() else {}


def test_a_recording_is_read_by_other_programs_and_replayed_bit_for_bit(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = record(graph, path)
    graph.wait(lambda: "ready" in path.with_suffix(".log").read_text(), "the recorder")
    # nodes that come after the recorder
    graph.start_ready("simulator_node", environment="PandaReach-v3", real_time_factor=0.0, synchronous=True)
    graph.start_ready("policy_node", autostart=True)
    # of both: a busy machine may find one topic a hundred steps after the other
    graph.wait(lambda: min(counted(path).get(t, 0) for t in ("/action", "/observation")) > 120, "a hundred steps")
    recorder.send_signal(signal.SIGINT)
    out, _ = recorder.communicate(timeout=30)
    assert recorder.returncode == 0, path.with_suffix(".log").read_text()
    result = json.loads(out)
    assert {row["topic"]: row["messages"] for row in result["topics"]} == counted(path)
    assert {"/observation", "/action", "/joint_states", "/goal_pose", "/clock", "/status"} <= set(counted(path))

    ours = [message for message in RecordingReader(path).messages() if message.topic.kind.endswith("/Action")]
    with AnyReader([path]) as bag:
        assert {c.topic: c.msgcount for c in bag.connections} == counted(path)
        actions = [c for c in bag.connections if c.topic == "/action"]
        theirs = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages(connections=actions)]
    for message, other in zip(ours, theirs, strict=True):
        original = deserialize_message(message.data, Action)
        assert original.observation == other.observation
        np.testing.assert_array_equal(original.values, other.values)

    done = drs("replay", path, "panda_reach", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["equal"] == found["actions"] > 100 and found["complete"]


def test_what_the_arm_was_told_is_recorded_too(graph: Graph, tmp_path: Path) -> None:
    path, watched = tmp_path / "arm.mcap", Watched(graph)
    graph.start_ready("mock_arm_node")
    graph.start_ready("policy_node", input="arm", autoconfigure=True, **PATIENT)
    # patterns, and an end of its own
    recorder = record(graph, path, "--topics", "/policy_node/*,/joint_command", "--seconds", "12")
    log = path.with_suffix(".log")
    # a topic that is there already takes a moment to be found
    topics = ("/policy_node/observation", "/policy_node/action", "/joint_command")
    graph.wait(lambda: all(f"recording {topic}" in log.read_text() for topic in topics), "the recorder")
    watched.send_goal((0.6, 0.1, 0.25))
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    graph.wait(lambda: recorder.poll() is not None, "the end of the recording")
    assert recorder.returncode == 0
    recorded = counted(path)
    assert recorded["/joint_command"] > 50 and "/joint_states" not in recorded
    seen = [m for m in RecordingReader(path).messages() if m.topic.kind.endswith("/Observation")]
    first = deserialize_message(seen[0].data, Observation)
    assert first.number == 1 and first.step == 0 and list(first.keys)[-1] == "observation"
    found = json.loads(drs("replay", path, "panda_reach", "--json").stdout)
    assert found["topic"] == "/policy_node/observation" and found["equal"] == found["actions"] > 10


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_recorder_that_is_ended_leaves_what_came(graph: Graph, tmp_path: Path, number: int) -> None:
    path = tmp_path / "killed.mcap"
    node = graph.start_ready("recorder_node", output=path, topics="/observation,/obervation")
    graph.start_ready("simulator_node", environment="PandaReach-v3")
    graph.wait(lambda: counted(path).get("/observation", 0) > 20, "twenty observations on the disk")
    node.send(number)
    node.process.wait(timeout=20)
    found = contents(path)
    assert sum(found.counts.values()) > 20
    assert found.complete == (number == signal.SIGTERM)
    assert node.said("no topic was called /obervation") == (number == signal.SIGTERM)
    assert not node.said("no topic was called /observation")
    assert not node.said("Traceback")


def test_without_room_it_says_so(graph: Graph) -> None:
    node = graph.start("recorder_node", output="/dev/full", topics="/observation")
    graph.start_ready("simulator_node", environment="PandaReach-v3")
    assert node.process.wait(timeout=40) == 1
    assert node.said("Cannot write /dev/full") and not node.said("Traceback")
