"""A publisher that offers less than those before it is recorded as well, and of theirs nothing is lost or twice."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from drs_core.recording.reader import RecordingReader
from tests.ros.graph import Graph

LATCHED = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RELIABLE = QoSProfile(depth=1000)
BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


def texts(path: Path) -> list[str]:
    return [deserialize_message(message.data, String).data for message in RecordingReader(path).messages()]


def sender(graph: Graph, name: str, qos: QoSProfile) -> Callable[[], None]:
    """Publishes its name with a number, one more each time."""
    publisher, count = graph.client.create_publisher(String, "late", qos), 0

    def send() -> None:
        nonlocal count
        publisher.publish(String(data=f"{name}{count}"))
        count += 1

    return send


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (RELIABLE, BEST_EFFORT, "by best effort"),
        (LATCHED, RELIABLE, "reliably, not latched"),
        (LATCHED, BEST_EFFORT, "by best effort"),
    ],
)
def test_a_publisher_that_offers_less_is_recorded(
    graph: Graph, tmp_path: Path, before: QoSProfile, after: QoSProfile, said: str
) -> None:
    path = tmp_path / "x.mcap"
    first = sender(graph, "a", before)
    node = graph.start_ready("recorder_node", output=path, topics="/late")
    graph.wait(lambda: node.said("recording /late ("), "the topic")
    # what is sent before the subscription is matched would be lost
    graph.wait(lambda: graph.client.count_subscribers("late") == 1, "the recorder's subscription")
    first()
    graph.wait(lambda: "a0" in texts(path), "the first message")
    second = sender(graph, "b", after)
    # closely, so that a gap would show, and for less long than both subscriptions are there
    for _ in range(600):
        first(), second()
        time.sleep(0.001)
    graph.wait(lambda: "a600" in texts(path) and sum(text[0] == "b" for text in texts(path)) > 20, "messages of both")
    assert node.said(f"recording /late {said}")
    assert not node.said("incompatible QoS")
    node.send(signal.SIGTERM)
    node.process.wait(timeout=20)
    found = texts(path)
    assert len(set(found)) == len(found)
    assert [text for text in found if text[0] == "a"] == [f"a{number}" for number in range(601)]


def test_one_subscription_is_left(graph: Graph, tmp_path: Path) -> None:
    first = sender(graph, "a", RELIABLE)
    node = graph.start_ready("recorder_node", output=tmp_path / "x.mcap", topics="/late")
    graph.wait(lambda: node.said("recording /late ("), "the topic")
    second = sender(graph, "b", BEST_EFFORT)
    graph.wait(lambda: node.said("recording /late by best effort"), "the weaker one")
    graph.wait(lambda: graph.client.count_subscribers("late") == 1, "the end of the first")
    graph.client.create_timer(0.02, lambda: (first(), second()))
    graph.wait(lambda: {"a", "b"} <= {text[0] for text in texts(tmp_path / "x.mcap")}, "messages of both")
