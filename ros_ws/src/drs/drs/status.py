"""What the policy node says on `status`, latched: who comes later knows it too."""

from __future__ import annotations

from drs_interfaces.msg import PolicyStatus
from rclpy.node import Node

from drs.qos import LATCHED, NO_PUBLISHER_EVENTS


class Status:
    """The newest status, and its publisher.

    Attributes:
        message: what was said last; counts and latency are filled in by whoever counts them.
    """

    def __init__(self, node: Node) -> None:
        """Say nothing yet."""
        self._node, self.message = node, PolicyStatus()
        self._publisher = node.create_publisher(PolicyStatus, "status", LATCHED, **NO_PUBLISHER_EVENTS)

    def of_agent(self, name: str, digest: str) -> None:
        """Name the agent from now on; empty: none."""
        self.message.agent, self.message.agent_digest = name, digest
        self.forget()

    def forget(self) -> None:
        """Count anew."""
        self.message.answered = self.message.refused = 0
        self.message.latency_s = 0.0

    def say(self, state: int, sentence: str) -> None:
        """Publish a state, one of PolicyStatus's constants, in a sentence."""
        self.message.state, self.message.message = state, sentence
        self.message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(self.message)
