"""recorder_node: writes the topics of the graph, serialised as they come, to an MCAP file."""

from __future__ import annotations

import importlib
import sys
import time
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rclpy.node import Node
from rclpy.qos import QoSProfile

from drs.declare import Declared, declare
from drs.discovery import see_whole_graph
from drs.run_node import run_node
from drs.topic_subscription import TopicSubscription
from drs_core.errors import UsageError
from drs_core.recording.definitions import whole_definition
from drs_core.recording.writer import RecordingWriter

PARAMETERS = (
    Declared("output", "recording.mcap", "file to write; one that is there is replaced"),
    Declared("topics", "", "whole names or patterns with commas between; empty: all but hidden ones"),
    Declared("seconds", 0.0, "end after so long [s]; 0: when told", low=0.0, high=1e7),
)
_LOOK_S = 0.2
_SAY_S = 10.0
_LEFT_OUT = "/parameter_events"


class RecorderNode(Node):
    """Subscribes to what there is, and to what comes later."""

    def __init__(self) -> None:
        """Begin the file and look around."""
        super().__init__("recorder_node")
        p = declare(self, PARAMETERS)
        self._patterns = [pattern.strip() for pattern in p["topics"].split(",") if pattern.strip()]
        self._writer = RecordingWriter(Path(p["output"]))
        self._begun_s = self._said_s = time.monotonic()
        self._seconds, self._known = p["seconds"], set[str]()
        self._recorded: list[TopicSubscription] = []
        self.create_timer(_LOOK_S, self._look)
        self._look()
        self.get_logger().info(f"recording to {p['output']}; ready")

    def destroy_node(self) -> None:
        """Write the end of the file."""
        self._writer.close()
        for pattern in self._patterns:
            if not any(fnmatchcase(topic, pattern) for topic in self._known):
                self.get_logger().warning(f"no topic was called {pattern}; of it nothing is in the file")
        super().destroy_node()

    def _look(self) -> None:
        now_s = time.monotonic()
        if self._seconds and now_s - self._begun_s >= self._seconds:
            raise KeyboardInterrupt
        if now_s - self._said_s >= _SAY_S:
            self._said_s = now_s
            self.get_logger().info(f"{now_s - self._begun_s:.0f} s, {self._writer.messages} messages")
        self._writer.flush()
        for recorded in self._recorded:
            recorded.tidy()
        for topic, kinds in self.get_topic_names_and_types():
            if topic not in self._known and self._wants(topic):
                self._subscribe(topic, kinds[0])

    def _wants(self, topic: str) -> bool:
        if self._patterns:
            return any(fnmatchcase(topic, pattern) for pattern in self._patterns)
        # hidden names begin with an underscore
        return topic != _LEFT_OUT and "/_" not in topic

    def _subscribe(self, topic: str, kind: str) -> None:
        publishers = self.get_publishers_info_by_topic(topic)
        if not publishers:
            # what a publisher offers is not known yet
            return
        self._known.add(topic)
        try:
            definition = whole_definition(kind, _text)
            package, _, name = kind.split("/")
            # only now: a package with definitions of messages may be imported, whoever named it
            message = getattr(importlib.import_module(f"{package}.msg"), name)
        except (UsageError, AttributeError, ImportError, ValueError) as error:
            self.get_logger().warning(f"{topic} is not recorded, its type {kind} is not installed: {error}")
            return
        offered = [publisher.qos_profile for publisher in publishers]
        self._writer.add_topic(topic, kind, definition, "\n".join(map(_qos_yaml, offered)))
        self._recorded.append(TopicSubscription(self, topic, message, offered, self._writer.write))
        self.get_logger().info(f"recording {topic} ({kind})")


@cache
def _text(package: str, name: str) -> str:
    try:
        share = Path(get_package_share_directory(package))
    except PackageNotFoundError:
        # of the wheels of ROS 2, which need no AMENT_PREFIX_PATH
        share = Path(sys.prefix) / "share" / package
    try:
        return (share / "msg" / f"{name}.msg").read_text()
    except OSError as error:
        raise UsageError(f"there is no definition of {package}/{name}") from error


def _qos_yaml(qos: QoSProfile) -> str:
    """What a publisher offers, as rosbag2 notes it."""
    return (
        f"- history: {qos.history.value}\n  depth: {qos.depth}\n  reliability: {qos.reliability.value}\n"
        f"  durability: {qos.durability.value}\n  deadline: {{sec: 2147483647, nsec: 4294967295}}\n"
        "  lifespan: {sec: 2147483647, nsec: 4294967295}\n  liveliness: 1\n"
        "  liveliness_lease_duration: {sec: 2147483647, nsec: 4294967295}\n"
        "  avoid_ros_namespace_conventions: false"
    )


def main() -> None:
    """Run the node."""
    see_whole_graph()
    run_node(RecorderNode)
