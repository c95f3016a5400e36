"""Qualities of service that several topics share."""

from __future__ import annotations

from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Who comes later gets the newest message too."""
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of measurements: drivers publish them reliably or not, and this takes both."""

NO_EVENTS: dict[str, Any] = {"event_callbacks": SubscriptionEventCallbacks(use_default_callbacks=False)}
NO_PUBLISHER_EVENTS: dict[str, Any] = {"event_callbacks": PublisherEventCallbacks(use_default_callbacks=False)}
"""For topics that cannot meet an incompatible other end, or not one worth a warning: the executor looks at each
event of a topic every time it wakes, a hundred times a second for each stream of measurements."""
