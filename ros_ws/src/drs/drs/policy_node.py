"""policy_node: a lifecycle node that answers observations with an agent's maximum likelihood action."""

from __future__ import annotations

import gc

from drs_interfaces.msg import PolicyStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from drs.agent_names import requested_agent
from drs.answering import offer
from drs.arm_topics import ArmTopics
from drs.declare import Declared, declare
from drs.diagnostics import Diagnostics, policy_status
from drs.policy_topics import PolicyTopics
from drs.run_node import run_node
from drs.serving_parameters import PARAMETERS as SERVING
from drs.status import Status
from drs.transitions import refuse_wrong_transitions
from drs_core.actor import Actor
from drs_core.errors import DrsError, UsageError
from drs_core.serving.arm import ARM_IDS
from drs_core.serving.states import State

PARAMETERS = (
    Declared("agent", "panda_reach", "agent that acts: a shipped name or a file"),
    Declared("agent_digest", "", "refuse any other agent than that of this sha256; empty: any"),
    Declared("arm_id", "panda", "what the arm's joints and frames are named after", allowed=ARM_IDS),
    Declared(
        "input",
        "observation",
        "what is answered: the topic observation; state: tip pose, twist and goal (PandaReach); "
        "arm: joint states, tip pose and goal, with every guard",
        allowed=("observation", "state", "arm"),
    ),
    Declared(
        "tip_velocity",
        "joints",
        "with the input arm: the tip's velocity from the joints' velocities, or from two tip poses",
        allowed=("joints", "pose"),
    ),
    Declared("publish_joint_command", True, "with the input arm: publish joint_command"),
    Declared("publish_joint_trajectory", False, "with the input arm: publish joint_trajectory"),
    Declared("publish_target_pose", False, "with the input arm: publish target_pose, the tip of the same motion"),
    Declared("publish_steps", True, "with the input arm: publish ~/observation and ~/action"),
    Declared(
        "realtime_priority",
        50,
        "with the input arm: SCHED_FIFO priority while active, memory locked, where the system allows it; 0: neither",
        low=0,
        high=99,
    ),
    *SERVING,
    Declared("autoconfigure", False, "configure as soon as the node runs; it stays inactive until told"),
    Declared("autostart", False, "configure and activate as soon as the node runs; not with the input arm"),
)


class PolicyNode(LifecycleNode):
    """Declares, wires and changes state."""

    def __init__(self) -> None:
        """Begin unconfigured, or where a parameter says so inactive or active."""
        super().__init__("policy_node")
        self._p, self._topics, self._active = declare(self, PARAMETERS), None, False
        self.add_on_set_parameters_callback(self._keep_clock)
        if self._p["autostart"] and self._p["input"] == "arm":
            # a node that is started again by whatever watches over it must not move an arm by itself
            raise UsageError("autostart does not go with the input arm; use autoconfigure, and activate by hand.")
        self._status = Status(self)
        self._status.say(PolicyStatus.UNCONFIGURED, State.UNCONFIGURED.value)
        Diagnostics(self, lambda: policy_status(self._status.message, self._topics.figures() if self._topics else {}))
        refuse_wrong_transitions(self)
        begun = self._p["autoconfigure"] or self._p["autostart"]
        configured = begun and self.trigger_configure() == TransitionCallbackReturn.SUCCESS
        if configured and self._p["autostart"]:
            self.trigger_activate()
        offer(self, Trigger, "~/reset_fault", self._reset_fault, self.default_callback_group)
        self.get_logger().info("ready")

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load and verify the agent, warm it up, wire its topics."""
        try:
            name, agent = requested_agent("", self._p["agent"], "")
            actor = Actor(agent)
            if self._p["agent_digest"] not in ("", actor.digest):
                raise UsageError(f"The agent's digest is {actor.digest}, not agent_digest {self._p['agent_digest']}.")
            self._status.of_agent(name, actor.digest)
            if self._p["input"] == "arm":
                self._topics = ArmTopics(self, actor, self._status, self._p)
            elif self._p["arm_id"] == "fr3":
                raise UsageError("The arm fr3 is served with the input arm, which keeps its limits.")
            else:
                self._topics = PolicyTopics(self, actor, self._status, self._p["arm_id"], self._p["input"])
        except DrsError as error:
            self.get_logger().error(str(error))
            self._status.of_agent("", "")
            self._status.say(PolicyStatus.UNCONFIGURED, str(error))
            return TransitionCallbackReturn.FAILURE
        self.get_logger().info(f"configured: {name} for {agent.environment}")
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer observations, unless there is a fault: that is for somebody to reset."""
        if self._refuses_for_fault():
            return TransitionCallbackReturn.FAILURE
        result = super().on_activate(state)
        # all that has been loaded stays: no collection needs to walk over it while somebody waits for an answer
        gc.collect()
        gc.freeze()
        self._topics.activate()
        self._active = True
        self.get_logger().info("active")
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer no more."""
        self._topics.deactivate()
        self._active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the agent, unless there is a fault: that is for somebody to reset."""
        return TransitionCallbackReturn.FAILURE if self._refuses_for_fault() else self._end()

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the agent, for good."""
        return self._end()

    def _keep_clock(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse another clock, which would stop an arm's commands in mid-motion."""
        refused = self._topics is not None and any(parameter.name == "use_sim_time" for parameter in parameters)
        reason = "use_sim_time stays as it is while an agent is configured; clean up first." if refused else ""
        return SetParametersResult(successful=not refused, reason=reason)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the agent after a bug, which rclpy keeps to itself: nothing is to act for a node that is unconfigured.

        What is wired now would otherwise go on, beside what the next transition wires.
        """
        self.get_logger().error(
            f"A transition from the state {state.label} failed inside the node; it is unconfigured."
        )
        self._active = False
        return self._end()

    def _refuses_for_fault(self) -> bool:
        refused = self._topics is not None and self._topics.is_faulty
        if refused:
            self.get_logger().error(f"There is a fault; reset it first (~/reset_fault). {self._status.message.message}")
        return refused

    def _reset_fault(self, request: Trigger.Request, response: Trigger.Response) -> None:
        if self._topics is None or not self._topics.is_faulty:
            raise UsageError("There is no fault.")
        response.message = self._topics.reset_fault()
        # whoever resets a fault still has to say go
        if self._active:
            self.trigger_deactivate()

    def _end(self) -> TransitionCallbackReturn:
        if self._topics is not None:
            if self._active:
                # ends in mid-motion what a shutdown ends, priority too
                self._topics.deactivate()
                self._active = False
            self._topics.close()
            self._topics = None
            self._status.of_agent("", "")
            self._status.say(PolicyStatus.UNCONFIGURED, State.UNCONFIGURED.value)
        return TransitionCallbackReturn.SUCCESS


def main() -> None:
    """Run the node."""
    run_node(PolicyNode)
