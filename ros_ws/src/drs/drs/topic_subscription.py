"""A topic while it is recorded, at the quality of service of the weakest publisher that it has had."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from rclpy.subscription import Subscription

_DEPTH = 1000
_HAND_OVER_S = 2.0

Write = Callable[[str, bytes, int, int], None]
"""Topic, data, when it was received and sent [ns since 1970]."""


class TopicSubscription:
    """Subscribes, and again with less where a publisher comes that offers less: what is asked for in vain is not sent.

    Two subscriptions overlap for a moment, so that nothing of the publishers before is lost; what came by both
    is written once.
    """

    def __init__(self, node: Node, topic: str, message: Any, offered: Sequence[QoSProfile], write: Write) -> None:
        """Subscribe, reliable or latched only where every publisher is.

        Args:
            node: that subscribes.
            topic: its whole name.
            message: class of its messages.
            offered: by its publishers.
            write: is given every message.
        """
        self._node, self._topic, self._message, self._write = node, topic, message, write
        self._reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        self._latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        self._weakened_s, self._taken = -math.inf, set[tuple[int, int]]()
        self._before: list[Subscription] = []
        self._now = self._subscribe()

    def tidy(self) -> None:
        """End the subscription before, once the new one has had time to find the publishers."""
        since_s = time.monotonic() - self._weakened_s
        if since_s >= _HAND_OVER_S:
            while self._before:
                self._node.destroy_subscription(self._before.pop())
        # later: the new one may still hold what the one before has given
        if since_s >= 2 * _HAND_OVER_S:
            self._taken.clear()

    def _subscribe(self) -> Subscription:
        qos = QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if self._reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if self._latched else DurabilityPolicy.VOLATILE,
        )
        events = SubscriptionEventCallbacks(incompatible_qos=self._weaken)
        return self._node.create_subscription(
            self._message, self._topic, self._take, qos, event_callbacks=events, raw=True
        )

    def _weaken(self, event: QoSRequestedIncompatibleQoSInfo) -> None:
        policy = event.last_policy_kind
        if policy == QoSPolicyKind.RELIABILITY:
            weaker, self._reliable = self._reliable, False
        elif policy == QoSPolicyKind.DURABILITY:
            weaker = self._latched
        else:
            self._node.get_logger().warning(
                f"a publisher of {self._topic} is not recorded: its {qos_policy_name_from_kind(policy)} does not fit"
            )
            return
        if not weaker:
            # of the subscription before, which is told of the publisher too
            return
        # latched needs reliable, and would bring once more what is in the file
        self._latched = False
        self._before.append(self._now)
        self._now, self._weakened_s = self._subscribe(), time.monotonic()
        how = "reliably, not latched" if self._reliable else "by best effort"
        self._node.get_logger().info(f"recording {self._topic} {how} from now on: a new publisher offers no more")

    def _take(self, data: bytes, info: dict[str, int]) -> None:
        sent_ns = info["source_timestamp"]
        if self._before or self._taken:
            this = sent_ns, hash(data)
            if this in self._taken:
                return
            self._taken.add(this)
        self._write(self._topic, data, info["received_timestamp"] or time.time_ns(), sent_ns)
