"""What moves a stream on: its own clock, commands, or a client that resets and steps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from drs_interfaces.srv import Reset, Step
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from drs.answering import offer
from drs.conversions import action_from, seed_from
from drs.simulator_topics import SimulatorTopics
from drs.stream import Stream
from drs_core.errors import UsageError

FASTEST_PERIOD_S = 1e-4
REPEAT_PERIOD_S = 0.5


@dataclass(frozen=True)
class Pace:
    """When a stream moves.

    Attributes:
        real_time_factor: 1 is wall clock, 0 as fast as it goes.
        synchronous: wait for the command that answers the newest observation.
    """

    real_time_factor: float
    synchronous: bool

    def tick_s(self, period_s: float) -> float:
        """Wall time between ticks [s] for a simulated time of `period_s` a step."""
        return period_s / self.real_time_factor if self.real_time_factor > 0.0 else FASTEST_PERIOD_S

    @property
    def by_command(self) -> bool:
        """Whether each command moves the stream at once, without ticks."""
        return self.synchronous and self.real_time_factor == 0.0


class StreamDriver:
    """Wires a stream to a node's timers, commands and services."""

    def __init__(self, node: Node, stream: Stream, pace: Pace, seed: int) -> None:
        """Begin the episode of this seed."""
        self._stream, self._pace, self._stepped, self._waited = stream, pace, False, False
        group = MutuallyExclusiveCallbackGroup()
        self._topics = SimulatorTopics(node, stream, group, self._on_command)
        offer(node, Reset, "~/reset", self._reset, group)
        offer(node, Step, "~/step", self._step, group)
        self._topics.publish(stream.reset(seed))
        # simulated time is what this node makes, so its timers run on the machine's clock
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        if not pace.by_command:
            node.create_timer(pace.tick_s(stream.period_s), self._tick, group, clock)
        if pace.synchronous:
            # whoever joins late, or missed it, still gets the observation that is waited for
            node.create_timer(REPEAT_PERIOD_S, self._repeat, group, clock)

    def _tick(self) -> None:
        if self._stepped:
            return
        if self._pace.synchronous and not (self._topics.answered() or self._stream.frame.done):
            return
        self._advance()

    def _on_command(self) -> None:
        if self._pace.by_command and not self._stepped and self._topics.answered():
            self._advance()
            if self._stream.frame.done:
                self._advance()

    def _advance(self) -> None:
        self._waited = False
        self._topics.publish(self._stream.step(self._topics.take_command()))

    def _repeat(self) -> None:
        if not self._stepped and self._waited:
            self._topics.repeat()
        self._waited = True

    def _reset(self, request: Any, response: Any) -> None:
        seed = seed_from(request.seed)
        self._stepped = request.stepped
        self._topics.take_command()
        response.observation = self._topics.publish(self._stream.reset(seed))
        response.message = f"Episode {request.seed} has begun."

    def _step(self, request: Any, response: Any) -> None:
        if not self._stepped:
            raise UsageError("The episode moves on by itself; call reset with stepped = true first.")
        if self._stream.frame.done:
            raise UsageError("The episode has ended; call reset.")
        if self._stream.interface != "action":
            raise UsageError(f"The simulator takes {self._stream.interface}; step needs command_interface = action.")
        spaces = self._stream.environment.spaces
        frame = self._stream.step(action_from(request.action, spaces.low, spaces.high))
        response.observation = self._topics.publish(frame)
        response.message = f"Step {frame.count} is done."
