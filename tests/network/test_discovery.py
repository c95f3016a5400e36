"""Simulators are found without multicast: by a list of hosts, or by a discovery server."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drs_core.agent import Agent
from tests.network.hosts import Host
from tests.network.nodes import Nodes
from tests.network.test_updates import SHORT
from tests.ros.test_rollouts import same

PORT = 11811


@contextmanager
def discovery_server(host: Host, log: Path) -> Iterator[str]:
    """A discovery server on a host; gives its address as ROS_DISCOVERY_SERVER takes it."""
    # its wheel has it beside the interpreter, which it starts by name
    programs = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    command = [*host.inside, "fastdds", "discovery", "-i", "0", "-l", host.address, "-p", str(PORT)]
    with open(log, "wb") as file:
        server = subprocess.Popen(
            command,
            env={**os.environ, "PATH": programs},
            # a terminal would be asked for a key that ends it
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield f"{host.address}:{PORT}"
    finally:
        # the group: the server is a child of what entered the host
        os.killpg(server.pid, signal.SIGKILL)
        server.wait()


def test_by_a_list_of_hosts(nodes: Nodes, expected: Agent) -> None:
    before = nodes.network.impair(multicast=False)
    nodes.simulators()
    hosts = ";".join(host.address for host in nodes.network.hosts[1:])
    tuner = nodes.tuner("run", SHORT, ROS_STATIC_PEERS=hosts)
    nodes.finish(tuner)
    assert nodes.network.impair().blocked > before.blocked
    assert same(nodes.folder / "run", expected)


def test_by_a_discovery_server(nodes: Nodes, expected: Agent) -> None:
    nodes.network.impair(multicast=False)
    with discovery_server(nodes.network.hosts[0], nodes.folder / "server.log") as address:
        nodes.simulators(ROS_DISCOVERY_SERVER=address)
        nodes.finish(nodes.tuner("run", SHORT, ROS_DISCOVERY_SERVER=address))
    assert same(nodes.folder / "run", expected)
