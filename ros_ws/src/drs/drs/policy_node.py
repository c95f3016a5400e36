"""policy_node: a lifecycle node that answers observations with an agent's maximum likelihood action."""

from __future__ import annotations

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from drs.actor import Actor
from drs.agent_names import requested_agent
from drs.declare import Declared, declare
from drs.diagnostics import Diagnostics, policy_status
from drs.policy_topics import PolicyTopics
from drs.run_node import run_node
from drs_core.errors import DrsError

PARAMETERS = (
    Declared("agent", "panda_reach", "agent that acts: a shipped name or a file"),
    Declared("arm_id", "panda", "what the arm's joints and frames are named after", allowed=("panda", "fer")),
    Declared(
        "input",
        "observation",
        "what is answered: the topic observation, or state: tip pose, twist and goal (PandaReach)",
        allowed=("observation", "state"),
    ),
    Declared("autoconfigure", False, "configure as soon as the node runs; it stays inactive until told"),
    Declared("autostart", False, "configure and activate as soon as the node runs"),
)


class PolicyNode(LifecycleNode):
    """Declares, wires and changes state."""

    def __init__(self) -> None:
        """Begin unconfigured, or where a parameter says so inactive or active."""
        super().__init__("policy_node")
        self._p, self._topics = declare(self, PARAMETERS), None
        Diagnostics(self, lambda: policy_status(self._topics.status) if self._topics else None)
        if self._p["autoconfigure"] or self._p["autostart"]:
            self.trigger_configure()
        if self._p["autostart"]:
            self.trigger_activate()
        self.get_logger().info("ready")

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load and verify the agent, warm it up, wire its topics."""
        try:
            name, agent = requested_agent("", self._p["agent"], "")
            self._topics = PolicyTopics(self, Actor(agent), name, self._p["arm_id"], self._p["input"])
        except DrsError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self.get_logger().info(f"configured: {name} for {agent.environment}")
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer observations."""
        result = super().on_activate(state)
        self._topics.activate()
        self.get_logger().info("active")
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer no more."""
        self._topics.deactivate()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the agent."""
        return self._end()

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the agent, for good."""
        return self._end()

    def _end(self) -> TransitionCallbackReturn:
        if self._topics is not None:
            self._topics.close()
            self._topics = None
        return TransitionCallbackReturn.SUCCESS


def main() -> None:
    """Run the node."""
    run_node(PolicyNode)
