"""A graph a test, in a domain that no other test has."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

pytest.importorskip("rclpy", reason="these tests need ROS 2 (make ros)")
pytest.importorskip("drs_interfaces", reason="these tests need the built workspace (make ros)")

from domain_coordinator import domain_id

from tests.ros.graph import NODES, Graph


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Graph]:
    assert NODES.is_dir(), f"the workspace is not built: {NODES} is missing (make ros)"
    with domain_id() as domain:
        made = Graph(domain, tmp_path)
        try:
            yield made
        finally:
            made.close()
