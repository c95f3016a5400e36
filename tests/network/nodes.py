"""Nodes on the hosts of a network, set up as a user would: by environment variables."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import psutil

from tests.network.hosts import Host, Network
from tests.ros.graph import PATIENCE_S, NodeProcess
from tests.ros.test_rollouts import done

DISCOVERY = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_DOMAIN_ID": "42"}
_LOOK_S = 0.02


class Nodes:
    """The tuner is on the first host, a simulator on each of the others."""

    def __init__(self, network: Network, folder: Path) -> None:
        self.network, self.folder, self.started = network, folder, list[NodeProcess]()

    def start(self, host: Host, executable: str, name: str, more: dict[str, str], **parameters: Any) -> NodeProcess:
        environment = {**os.environ, **DISCOVERY, "ROS_LOG_DIR": str(self.folder / "log"), **more}
        log = self.folder / f"{name}.log"
        node = NodeProcess(executable, name, parameters, log, environment, host.inside)
        self.started.append(node)
        return node

    def simulators(self, **more: str) -> list[NodeProcess]:
        """One on each host but the first, ready; `more` are environment variables."""
        hosts = self.network.hosts[1:]
        made = [self.start(host, "simulator_node", f"simulator_{host.number}", more, stream=False) for host in hosts]
        for node in made:
            self.wait(lambda node=node: node.said("ready"), node.name)
        return made

    def tuner(self, run: str, settings: dict[str, Any], **more: str) -> NodeProcess:
        """Tunes into the folder `run` of this folder, and ends; `more` are environment variables."""
        given = settings | {"autostart": True, "exit_when_done": True, "output": self.folder / run}
        return self.start(self.network.hosts[0], "tuner_node", f"tuner_{run}", more, **given)

    def finish(self, tuner: NodeProcess, patience_s: float = 100.0) -> None:
        """Wait for the end of a tuner, with success."""
        self.wait(lambda: done(tuner), "the end of tuning", patience_s)
        assert tuner.process.returncode == 0, tuner.log.read_text()

    def wait(self, condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
        end = time.monotonic() + patience_s
        while not condition():
            logs = "\n".join(f"--- {node.name}\n{node.log.read_text()[-2000:]}" for node in self.started)
            assert time.monotonic() < end, f"waited {patience_s} s for {what}\n{logs}"
            time.sleep(_LOOK_S)

    def close(self) -> None:
        for node in self.started:
            node.kill()


def cpu_s(node: NodeProcess) -> float:
    """Processor time that a node has used [s]; what enters the host is its parent."""
    entering = psutil.Process(node.process.pid)
    return sum(sum(one.cpu_times()[:2]) for one in [entering, *entering.children(recursive=True)])


def history(run: Path) -> list[dict[str, Any]]:
    """A line for each update."""
    return [json.loads(line) for line in (run / "history.jsonl").read_text().splitlines()]


def rollouts_per_second(updates: Sequence[dict[str, Any]]) -> float:
    """Of updates together [1/s]."""
    wall_s = [update["wall_s"] for update in updates]
    return sum(update["rollouts_per_second"] * one_s for update, one_s in zip(updates, wall_s)) / sum(wall_s)
