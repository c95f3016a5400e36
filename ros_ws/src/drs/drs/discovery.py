"""What a node is told of the graph."""

from __future__ import annotations

import os


def see_whole_graph() -> None:
    """Be told of every node, where a discovery server is asked; to be called before rclpy begins.

    A discovery server tells a node only of those topics and services that it uses itself, so one
    that looks for them by their type would never find any.
    """
    os.environ.setdefault("ROS_SUPER_CLIENT", "TRUE")
