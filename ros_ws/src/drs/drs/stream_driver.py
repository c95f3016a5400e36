"""What moves a stream on: its own clock, commands, or a client that resets and steps it."""

from __future__ import annotations

from collections.abc import Callable
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
LOOK_PERIOD_S = 0.2


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
    """Wires a stream to a node's timers, commands and services.

    The stream is made when somebody first listens, commands, resets or steps: until then its
    simulator would cost 40 MB for nobody.
    """

    def __init__(self, node: Node, kind: str, make: Callable[[], Stream], pace: Pace, seed: int) -> None:
        """`kind` is the command interface; the first episode has this seed."""
        self._node, self._make, self._pace, self._seed = node, make, pace, seed
        self._running: Stream | None = None
        self._stepped, self._waited = False, False
        self._group = MutuallyExclusiveCallbackGroup()
        # simulated time is what this node makes, so its timers run on the machine's clock
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._topics = SimulatorTopics(node, kind, self._group, self._on_command)
        offer(node, Reset, "~/reset", self._reset, self._group)
        offer(node, Step, "~/step", self._step, self._group)
        # it is never cancelled: the executor fails where it holds the next call of a timer that was
        node.create_timer(LOOK_PERIOD_S, self._begin_if_wanted, self._group, self._clock)

    def _begin_if_wanted(self) -> None:
        if self._running is None and self._topics.wanted():
            self._topics.publish(self._stream().frame)

    def _stream(self) -> Stream:
        if self._running is not None:
            return self._running
        stream = self._running = self._make()
        stream.reset(self._seed)
        self._topics.attach(stream)
        if not self._pace.by_command:
            self._node.create_timer(self._pace.tick_s(stream.period_s), self._tick, self._group, self._clock)
        if self._pace.synchronous:
            # whoever joins late, or missed it, still gets the observation that is waited for
            self._node.create_timer(REPEAT_PERIOD_S, self._repeat, self._group, self._clock)
        return stream

    def _tick(self) -> None:
        if self._stepped:
            return
        if self._pace.synchronous and not (self._topics.answered() or self._stream().frame.done):
            return
        self._advance()

    def _on_command(self) -> None:
        if self._pace.by_command and not self._stepped and self._topics.answered():
            self._advance()
            if self._stream().frame.done:
                self._advance()

    def _advance(self) -> None:
        self._waited = False
        self._topics.publish(self._stream().step(self._topics.take_command()))

    def _repeat(self) -> None:
        if not self._stepped and self._waited:
            self._topics.repeat()
        self._waited = True

    def _reset(self, request: Any, response: Any) -> None:
        seed = seed_from(request.seed)
        self._stepped = request.stepped
        self._topics.take_command()
        response.observation = self._topics.publish(self._stream().reset(seed))
        response.message = f"Episode {request.seed} has begun."

    def _step(self, request: Any, response: Any) -> None:
        if not self._stepped:
            raise UsageError("The episode moves on by itself; call reset with stepped = true first.")
        stream = self._stream()
        if stream.frame.done:
            raise UsageError("The episode has ended; call reset.")
        if stream.interface != "action":
            raise UsageError(f"The simulator takes {stream.interface}; step needs command_interface = action.")
        spaces = stream.environment.spaces
        frame = stream.step(action_from(request.action, spaces.low, spaces.high))
        response.observation = self._topics.publish(frame)
        response.message = f"Step {frame.count} is done."
