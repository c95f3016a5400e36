"""Where measuring nodes meet: on this machine, in a domain that nobody else is likely to use."""

from __future__ import annotations

import os

_DOMAINS = 100


def own_domain() -> None:
    """For this process and its children, unless the user chose."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % _DOMAINS))
