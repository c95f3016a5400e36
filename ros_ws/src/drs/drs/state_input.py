"""An observation made of what an arm measures, where nothing publishes `observation`: tip pose, twist, goal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Header

from drs.qos import LATCHED
from drs.state_conversions import position_of, velocity_of
from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.panda import BASE_FROM_WORLD_M

Float64 = NDArray[np.float64]
Answer = Callable[[Header, int, dict[str, Float64], int], None]

ENVIRONMENT = "PandaReach-v3"
"""The other tasks observe an object, which no standard topic tells."""
KEEP = 4


def reach_observation(tip: Float64, velocity: Float64, goal: Float64) -> dict[str, Float64]:
    """What PandaReach shows, from positions (3,) [m] in the frame of the base and a velocity (3,) [m/s].

    Rounded to float32 as panda-gym does, so that the policy sees the same.
    """
    here, there = (np.float64(np.float32(point - BASE_FROM_WORLD_M)) for point in (tip, goal))
    return {
        "achieved_goal": here,
        "desired_goal": there,
        "observation": np.concatenate((here, np.float64(np.float32(velocity)))),
    }


class StateInput:
    """Calls `answer` for every moment of which pose and twist are known, once a goal is."""

    def __init__(self, node: Node, agent: Agent, answer: Answer) -> None:
        """Subscribe.

        Raises:
            UsageError: the agent's observation cannot be made of an arm's state.
        """
        if agent.environment != ENVIRONMENT:
            raise UsageError(f"The input state works for {ENVIRONMENT}, not for {agent.environment}; use observation.")
        self._node, self._answer, self._count = node, answer, 0
        self._goal: PoseStamped | None = None
        self._poses: dict[Any, PoseStamped] = {}
        self._twists: dict[Any, TwistStamped] = {}
        # the executor looks in this order, so a new goal is mostly known before the next pose
        self.subscriptions = [
            node.create_subscription(PoseStamped, "goal_pose", self._on_goal, LATCHED),
            node.create_subscription(PoseStamped, "end_effector/pose", self._on_pose, 10),
            node.create_subscription(TwistStamped, "end_effector/twist", self._on_twist, 10),
        ]

    def _on_goal(self, message: PoseStamped) -> None:
        self._goal, self._count = message, 0

    def _on_pose(self, message: PoseStamped) -> None:
        keep(self._poses, message)
        self._try(moment(message))

    def _on_twist(self, message: TwistStamped) -> None:
        keep(self._twists, message)
        self._try(moment(message))

    def _try(self, key: tuple[int, int]) -> None:
        if self._goal is None or key not in self._poses or key not in self._twists:
            return
        pose, twist = self._poses[key], self._twists[key]
        try:
            observation = reach_observation(position_of(pose), velocity_of(twist), position_of(self._goal))
        except UsageError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        self._answer(pose.header, self._count, observation, self._count)
        self._count += 1


def moment(message: Any) -> tuple[int, int]:
    """A message's time stamp as a key."""
    return message.header.stamp.sec, message.header.stamp.nanosec


def keep(kept: dict[Any, Any], message: Any) -> None:
    """Keep a message by its moment, and the few before it."""
    kept[moment(message)] = message
    while len(kept) > KEEP:
        del kept[next(iter(kept))]
