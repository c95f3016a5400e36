"""Rollouts a second over simulator nodes and over local processes: same agents, same updates, one run.

Start it with the workspace sourced: source ros_ws/install/setup.bash, then python scripts/graph_throughput.py
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from rclpy.executors import MultiThreadedExecutor

from drs.fleet import Fleet
from drs.service_rollouts import Patience, ServiceRollouts
from drs.turns import Turns
from drs_core.agent import Agent
from drs_core.importing import resolve
from drs_core.rollouts import ProcessPool, Rollouts, Task
from drs_core.search import SearchConfig, ask


@contextmanager
def simulators(count: int, log: Path) -> Iterator[None]:
    """Simulator nodes without topics, in this process's domain."""
    executable = Path(get_package_prefix("drs")) / "lib" / "drs" / "simulator_node"
    started = []
    with open(log, "wb") as file:
        for number in range(count):
            name = f"simulator_{number}"
            command = [executable, "--ros-args", "-r", f"__node:={name}", "-p", "stream:=false"]
            started.append(subprocess.Popen(command, stdout=file, stderr=file, start_new_session=True))
        try:
            yield
        finally:
            for process in started:
                os.killpg(process.pid, signal.SIGINT)
                process.wait()


@contextmanager
def over_graph(agent: Agent, count: int, log: Path) -> Iterator[Rollouts]:
    """Rollouts over `count` simulator nodes of their own."""
    rclpy.init()
    node = rclpy.create_node("graph_throughput")
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        with simulators(count, log):
            yield ServiceRollouts(Fleet(node), Turns(), agent, Patience(no_simulator_s=30.0), lambda: False, print)
    finally:
        rclpy.shutdown()
        thread.join()


def measure(rollouts: Rollouts, agent: Agent, config: SearchConfig, update: int) -> tuple[float, float]:
    """Seconds for one update's rollouts, and the sum of their returns."""
    tasks = [Task(seed, frozenset(), perturbation) for perturbation, seed in ask(config, update)]
    start = time.perf_counter()
    episodes = rollouts.run(agent.theta, tasks)
    return time.perf_counter() - start, sum(episode.return_ for episode in episodes)


def compare(name: str, workers: int, updates: int, directions: int) -> dict[str, object]:
    """Both ways in turn, update by update, so that a busy machine slows both."""
    agent, config = resolve(name), SearchConfig(updates=updates + 1, directions=directions)
    seconds: dict[str, list[float]] = {"graph": [], "pool": []}
    with tempfile.TemporaryDirectory() as folder, closing(ProcessPool(agent, workers)) as pool:
        with over_graph(agent, workers, Path(folder) / "log") as graph:
            for rollouts in (graph, pool):  # the first update loads the agent and shows how long episodes are
                measure(rollouts, agent, config, 0)
            for update in range(1, updates + 1):
                took = {way: measure(r, agent, config, update) for way, r in (("graph", graph), ("pool", pool))}
                assert took["graph"][1] == took["pool"][1], "the two ways gave different returns"
                for way in seconds:
                    seconds[way].append(took[way][0])
    rates = {way: 2 * directions * updates / sum(times) for way, times in seconds.items()}
    return {
        "agent": name,
        "environment": agent.environment,
        "workers": workers,
        "rollouts": 2 * directions * updates,
        "graph_rollouts_per_second": rates["graph"],
        "pool_rollouts_per_second": rates["pool"],
        "graph_over_pool_percent": 100.0 * rates["graph"] / rates["pool"],
    }


def main() -> None:
    """Print a line of JSON for each agent."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("agents", nargs="*", default=["panda_reach"], help="agents; see: drs agents")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--updates", type=int, default=5)
    parser.add_argument("--directions", type=int, default=16)
    arguments = parser.parse_args()
    for name in arguments.agents:
        print(json.dumps(compare(name, arguments.workers, arguments.updates, arguments.directions)), flush=True)


if __name__ == "__main__":
    main()
