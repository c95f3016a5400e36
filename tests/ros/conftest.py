"""A graph a test, in a domain that no other test has. Without ROS 2 these tests skip, saying so."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import pytest

if TYPE_CHECKING:
    from tests.ros.graph import Graph

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

MISSING = [name for name in ("rclpy", "drs_interfaces", "drs") if find_spec(name) is None]

if MISSING:

    def pytest_pycollect_makemodule() -> NoReturn:
        pytest.skip(
            f"no module {MISSING[0]}: build the ROS 2 workspace (make ros) and source ros_ws/install/setup.bash"
        )


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Graph]:
    from domain_coordinator import domain_id

    from tests.ros.graph import NODES, Graph

    assert NODES.is_dir(), f"the workspace is not built: {NODES} is missing (make ros)"
    with domain_id() as domain:
        made = Graph(domain, tmp_path)
        try:
            yield made
        finally:
            made.close()
