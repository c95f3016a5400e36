"""Networks of three hosts. Without root, the tools or ROS 2 these tests skip, saying so."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import TYPE_CHECKING, NoReturn

import pytest

from tests.ros.conftest import MISSING

if TYPE_CHECKING:
    from drs_core.agent import Agent
    from tests.network.hosts import Network
    from tests.network.nodes import Nodes

if MISSING:

    def pytest_pycollect_makemodule() -> NoReturn:
        pytest.skip(f"no module {MISSING[0]}: build the ROS 2 workspace (make ros), source ros_ws/install/setup.bash")


UPDATES = 2


@pytest.fixture(scope="session")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Agent:
    """The agent that UPDATES updates give in this process."""
    from tests.ros.test_rollouts import in_process

    return in_process(tmp_path_factory.mktemp("expected") / "run", UPDATES, UPDATES)


@pytest.fixture(scope="module")
def network_of_three() -> Iterator[Network]:
    """Three hosts, for all tests of a module."""
    from tests.network.hosts import missing, network

    why = missing()
    if why:
        pytest.skip(why)
    with network(3) as made:
        yield made


@pytest.fixture(scope="module")
def shared_nodes(network_of_three: Network, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nodes]:
    """Nodes that all tests of a module share."""
    from tests.network.nodes import Nodes

    with closing(Nodes(network_of_three, tmp_path_factory.mktemp("nodes"))) as nodes:
        yield nodes


@pytest.fixture
def nodes(network_of_three: Network, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nodes]:
    """Nodes of one test, on a network without faults."""
    from tests.network.nodes import Nodes

    network_of_three.impair()
    with closing(Nodes(network_of_three, tmp_path_factory.mktemp("nodes"))) as nodes:
        yield nodes
