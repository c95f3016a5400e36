"""What the policy was shown and what it answered, for whoever records it: `~/observation` and `~/action`."""

from __future__ import annotations

import array

import numpy as np
from drs_interfaces.msg import Action, Observation
from rclpy.node import Node
from std_msgs.msg import Header

from drs.conversions import action_to_msg, floats
from drs.qos import NO_PUBLISHER_EVENTS
from drs.state_conversions import stamp
from drs_core.serving.server import Answer

_DEPTH = 10


class ArmSteps:
    """Two publishers."""

    def __init__(self, node: Node, environment: str) -> None:
        """`environment` is the one that the agent was trained in."""
        self._environment = environment
        self.publishers = (
            node.create_publisher(Observation, "~/observation", _DEPTH, **NO_PUBLISHER_EVENTS),
            node.create_publisher(Action, "~/action", _DEPTH, **NO_PUBLISHER_EVENTS),
        )

    def publish(self, answer: Answer, now_s: float) -> None:
        """Tell of an answer that was given at a moment of the node's clock [s]."""
        header, parts = Header(stamp=stamp(now_s)), answer.observation
        observation = Observation(
            header=header,
            number=answer.number,
            step=answer.step,
            environment=self._environment,
            keys=list(parts),
            sizes=array.array("I", map(len, parts.values())),
            values=floats(np.concatenate(list(parts.values())).astype(np.float64)),
            success=Observation.SUCCESS_UNDEFINED,
        )
        self.publishers[0].publish(observation)
        self.publishers[1].publish(action_to_msg(answer.target.action, header, answer.number))
