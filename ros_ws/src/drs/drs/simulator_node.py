"""simulator_node: one environment behind services (agents, episodes, reset, step) and topics."""

from __future__ import annotations

from functools import partial

from rclpy.executors import Executor, MultiThreadedExecutor
from rclpy.node import Node

from drs.agent_names import requested_agent
from drs.declare import Declared, declare
from drs.episode_service import EpisodeService
from drs.episode_services import EpisodeServices
from drs.run_node import run_node
from drs.stream import INTERFACES, Stream
from drs.stream_driver import Pace, StreamDriver

DEFAULT = "PandaReach-v3"
PARAMETERS = (
    Declared("environment", "", f"gymnasium id, and the only one then; empty: the agent's, or {DEFAULT} without one"),
    Declared("agent", "", "agent that an empty name in load_agent means: a shipped name or a file"),
    Declared("agents_root", "runs", "folder in which agents that requests name are looked up"),
    Declared("stream", True, "run episodes on the topics; false: only those that services ask for"),
    Declared("real_time_factor", 1.0, "speed on the topics [1]: 1 is wall clock, 0 as fast as it goes", 0.0, 1e3),
    Declared("command_interface", "action", "what moves the robot on the topics", allowed=INTERFACES),
    Declared("synchronous", False, "wait for the command that answers the newest observation"),
    Declared("fast_stepping", True, "step PyBullet faster, with the same results; false: as upstream does"),
    Declared("seed", 0, "seed of the first episode on the topics; the others follow one by one", 0, 2**31 - 1),
)


class SimulatorNode(Node):
    """Declares, wires and logs."""

    def __init__(self) -> None:
        """Load the agent, make the environment and offer everything."""
        super().__init__("simulator_node")
        p = declare(self, PARAMETERS)
        self._episodes = EpisodeService(p["environment"], p["fast_stepping"])
        EpisodeServices(self, self._episodes, p["agent"], p["agents_root"])
        # a wrong agent is said at once; its simulator is made when a tuner first asks for episodes
        agent = requested_agent("", p["agent"], p["agents_root"])[1] if p["agent"] else None
        environment = p["environment"] or (agent.environment if agent else DEFAULT)
        if p["stream"]:
            interface = p["command_interface"]
            make = partial(Stream, environment, interface, p["fast_stepping"])
            # what cannot be simulated is said at once
            make().close()
            StreamDriver(self, interface, make, Pace(p["real_time_factor"], p["synchronous"]), p["seed"])
        self.get_logger().info(f"ready: {environment}" if p["stream"] else "ready for episodes")

    def destroy_node(self) -> None:
        """End what is under way and free the simulators."""
        self._episodes.stop()
        super().destroy_node()


def _executor() -> Executor:
    # a batch of episodes and the topics each keep a thread busy; the third is for parameters
    return MultiThreadedExecutor(num_threads=3)


def main() -> None:
    """Run the node."""
    run_node(SimulatorNode, _executor)
