"""Simulator nodes that simulate nothing: `hollow.py AGENT NODES [sleep]` answers every batch at once.

Services, messages and checks are those of simulator_node; only the episodes are made up. So one
machine can hold as many of them as it takes to see what the tuner spends. A line on standard input
is the duration that episodes claim [s]; it is answered by the same line. With `sleep` they take it.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor

from drs.episode_service import EpisodeService
from drs.episode_services import EpisodeServices
from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.importing import resolve
from drs_core.policy import Float32
from drs_core.rollouts import Task


class Claimed:
    """How long an episode claims to take [s]; shared by all nodes of this process."""

    episode_s = 0.01
    sleep = False


class Hollow(EpisodeService):
    """An EpisodeService whose episodes end at once."""

    def __init__(self, claimed: Claimed) -> None:
        """Nothing is loaded."""
        super().__init__()
        self._claimed = claimed

    def load(self, agent: Agent, digest: str = "", backend: str = "python") -> None:
        """Hold this agent, without an environment."""
        self.agent, self.agent_digest, self.backend = agent, digest, backend

    def set_theta(self, theta: Float32, digest: str) -> None:
        """Hold theta."""
        self._theta, self._theta_digest = theta, digest

    def run(self, tasks: Sequence[Task], *digests: str) -> tuple[list[Episode], float]:
        """Made-up episodes of these tasks, and how long they claim to have taken [s]."""
        if self._claimed.sleep:
            time.sleep(self._claimed.episode_s * len(tasks))
        made = [Episode(task.seed, 1000.0, 1000, False, False, None, 0.1) for task in tasks]
        return made, self._claimed.episode_s * len(tasks)


def _listen(claimed: Claimed) -> None:
    for line in sys.stdin:
        claimed.episode_s = float(line)
        print(line, end="", flush=True)
    rclpy.try_shutdown()


def main() -> None:
    """Offer the services until standard input ends."""
    agent, count = sys.argv[1], int(sys.argv[2])
    resolve(agent)
    rclpy.init()
    claimed, kept = Claimed(), []
    claimed.sleep = sys.argv[3:] == ["sleep"]
    executor: Executor = MultiThreadedExecutor(count + 1) if claimed.sleep else SingleThreadedExecutor()
    for number in range(count):
        node: Any = rclpy.create_node(f"hollow_{number}", start_parameter_services=False, enable_rosout=False)
        kept.append(EpisodeServices(node, Hollow(claimed), agent, "."))
        executor.add_node(node)
    threading.Thread(target=_listen, args=(claimed,), daemon=True).start()
    print("ready", flush=True)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
