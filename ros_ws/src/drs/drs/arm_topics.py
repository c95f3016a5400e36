"""The policy on an arm: joint states, tip pose and goal come in, guarded commands go out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from drs_interfaces.msg import PolicyStatus
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.serialization import serialize_message
from rclpy.timer import Timer

from drs.arm_commands import ArmCommands
from drs.arm_inputs import ArmInputs
from drs.arm_steps import ArmSteps
from drs.serving_parameters import serving_config
from drs.status import Status
from drs_core.actor import Actor
from drs_core.serving.arm import read_arm
from drs_core.serving.motion import Motion
from drs_core.serving.observing import observation, task_of
from drs_core.serving.priority import real_time
from drs_core.serving.results import Effect, Result, Verdict
from drs_core.serving.server import Server
from drs_core.serving.states import Event, State
from drs_core.serving.timing import Stopwatch

_STATES = {
    State.UNCONFIGURED: PolicyStatus.UNCONFIGURED,
    State.INACTIVE: PolicyStatus.INACTIVE,
    State.WAITING: PolicyStatus.WAITING,
    State.RUNNING: PolicyStatus.ACTING,
    State.HOLDING: PolicyStatus.HOLDING,
    State.FAULT: PolicyStatus.FAULT,
}
_PUBLISHERS_EVERY_S = 0.2
_WATCH_EVERY_S = 0.05
_REHEARSALS, _REHEARSAL_S = 2, 0.004
"""Before a step, and how long they may take: on a slow computer that has idled some 2 ms and 1 ms."""


class ArmTopics:
    """Subscriptions, publishers and the timer of a policy node that commands an arm."""

    def __init__(self, node: LifecycleNode, actor: Actor, status: Status, values: Mapping[str, Any]) -> None:
        """Wire everything; nothing is published but the status before `activate`.

        Raises:
            UsageError: the agent cannot be served to an arm, or a setting is out of its range.
            DrsError: what serving needs is not installed.
        """
        config = serving_config(values)
        self._node, self._clock = node, node.get_clock()
        self._arm, task = read_arm(values["arm_id"]), task_of(actor.agent.environment)
        zero, still = np.zeros(3), np.zeros(6)
        # sizes that do not fit are found out here, once
        actor.act(observation(task, zero, zero, zero, 0.0, zero, (0.0, 0.0, 0.0, 1.0), still), 0)
        self._server = Server(self._arm, task, actor.answer, config)
        self._server.tell(Event.CONFIGURE)
        self._status, self._priority = status, values["realtime_priority"]
        self._measured = ArmInputs(node, self._arm, task, values["tip_velocity"])
        self._observed_s, self._said = -math.inf, None
        # until a command is published, and until it is there to be published
        self._stopwatch, self._decisions = Stopwatch(config.policy_period_s), Stopwatch(config.policy_period_s)
        self._commands = ArmCommands(node, self._arm, task.has_gripper, values)
        self._steps = ArmSteps(node, actor.agent.environment) if values["publish_steps"] else None
        self._tick_timer = node.create_timer(config.command_period_s, self._tick)
        self._timers = [self._tick_timer, node.create_timer(_PUBLISHERS_EVERY_S, self._look_for_others)]
        # where the node's clock is set back, the timers above wait until it says again what it said
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers.append(node.create_timer(_WATCH_EVERY_S, self._watch, clock=steady))
        self._motion: Motion | None = None
        self._rehearsal: Timer | None = None
        if config.command_period_s >= 2 * _REHEARSAL_S:
            # begun anew with every step, it comes so long before the next one
            self._rehearsal = node.create_timer(config.policy_period_s - _REHEARSAL_S, self._rehearse)
            self._timers.append(self._rehearsal)
        self._say()

    def activate(self) -> None:
        """Wait for input, then act."""
        self._status.forget()
        self._stopwatch.restart()
        self._decisions.restart()
        # 0 leaves what whoever started the node chose
        refused = real_time(self._priority) if self._priority else ""
        if refused:
            self._node.get_logger().warning(refused)
        self._server.tell(Event.ACTIVATE)
        # before the first command, not some commands later
        self._look_for_others()
        self._say()

    def deactivate(self) -> None:
        """Publish no command any more, at once; a fault stays."""
        self._server.tell(Event.DEACTIVATE)
        if self._priority:
            real_time(0)
        self._say()

    def reset_fault(self) -> str:
        """End a fault; what to say about it."""
        found = self._server.stand.sentence
        self._server.tell(Event.RESET)
        self._say()
        return f"Reset; activate the node to go on. The fault was: {found}"

    def figures(self) -> dict[str, str]:
        """What /diagnostics says besides the status."""
        timing, told = self._stopwatch.figures(), {}
        for what, found in (("latency", timing), ("latency without publishing", self._decisions.figures())):
            latencies = {"median": found.median_s, "99 %": found.p99_s, "worst": found.worst_s}
            told |= {f"{what}, {name} [ms]": f"{1e3 * value:.2f}" for name, value in latencies.items()}
        return {**told, "missed periods": str(timing.missed)}

    @property
    def is_faulty(self) -> bool:
        """Whether a fault has not been reset."""
        return self._server.stand.state is State.FAULT

    def close(self) -> None:
        """Take everything off the graph."""
        for timer in self._timers:
            self._node.destroy_timer(timer)
        for publisher in (*self._commands.publishers.values(), *(self._steps.publishers if self._steps else ())):
            self._node.destroy_publisher(publisher)
        for subscription in self._measured.subscriptions:
            self._node.destroy_subscription(subscription)

    def _now_s(self) -> float:
        return 1e-9 * self._clock.now().nanoseconds

    def _tick(self) -> None:
        self._tick_at(self._now_s())

    def _tick_at(self, now_s: float) -> None:
        begun, config = time.perf_counter(), self._server.config
        # by the clock and not by counting, so that a tick that is missed does not put off the next step;
        # a clock that went back is for the server to find
        due = abs(now_s - self._observed_s) >= config.policy_period_s - 0.5 * config.command_period_s
        verdict = self._server.observe(self._measured.newest(), now_s) if due else None
        motion = self._server.command(now_s, None if self._clock.ros_time_is_active else time.monotonic())
        decided_s = time.perf_counter() - begun
        if motion is not None:
            self._commands.publish(motion, self._server, now_s)
            self._motion = motion
        # after the command: for the rest nobody waits
        if verdict is not None and motion is not None:
            self._status.message.latency_s = time.perf_counter() - begun
            self._stopwatch.add(self._status.message.latency_s, now_s)
            self._decisions.add(decided_s, now_s)
        if verdict is not None:
            self._on_step(verdict, now_s)
        self._say()

    def _on_step(self, verdict: Verdict, now_s: float) -> None:
        # a step a little late does not put off those after it
        late_s = now_s - self._due_s()
        self._observed_s = self._due_s() if 0.0 <= late_s < 0.5 * self._server.config.command_period_s else now_s
        if self._rehearsal is not None:
            # before the next step's own moment, however late this one is
            wait_s = max(self._due_s() - self._now_s() - _REHEARSAL_S, _REHEARSAL_S)
            self._rehearsal.timer_period_ns = round(1e9 * wait_s)
            self._rehearsal.reset()
        self._count(verdict)
        if verdict.result is Result.OK and self._steps is not None:
            self._steps.publish(self._server.answer, now_s)

    def _count(self, verdict: Verdict) -> None:
        self._status.message.answered += verdict.result is Result.OK
        self._status.message.refused += verdict.result.effect in (Effect.HOLD, Effect.FAULT)

    def _rehearse(self) -> None:
        """Go through the coming step, and take it as soon as it is due."""
        if self._clock.ros_time_is_active:
            # simulated time stands still meanwhile: the step would not become due in here
            return
        called, due_s = time.perf_counter(), self._due_s()
        for _ in range(_REHEARSALS):
            now_s = self._now_s()
            # a step that is due already is not kept waiting
            if now_s >= due_s:
                break
            if self._motion is None or not self._server.rehearse(self._measured.newest(), now_s):
                return
            for _, message in self._commands.messages(self._motion, self._server, now_s):
                serialize_message(message)
        self._measured.take()
        # neither sleeping nor the executor keeps the caches as they are
        now_s = self._now_s()
        while now_s < due_s and time.perf_counter() < called + _REHEARSAL_S:
            now_s = self._now_s()
        self._tick_timer.reset()
        self._tick_at(now_s)

    def _due_s(self) -> float:
        return self._observed_s + self._server.config.policy_period_s

    def _watch(self) -> None:
        self._server.watch(self._now_s())
        self._say()

    def _look_for_others(self) -> None:
        for publisher in self._commands.publishers.values():
            # by the name that it has on the graph, which may be remapped
            topic = publisher.topic_name
            count = self._node.count_publishers(topic)
            if count > 1:
                self._server.report(Verdict(Result.OTHER_PUBLISHER, f"{topic} has {count} publishers."))
                self._say()

    def _say(self) -> None:
        stand = self._server.stand
        if stand == self._said:
            return
        if self._said is not None and stand.state is State.FAULT:
            self._node.get_logger().error(stand.sentence)
        elif self._said is None or stand.state is not self._said.state:
            self._node.get_logger().info(stand.sentence)
        self._said = stand
        self._status.say(_STATES[stand.state], stand.sentence)
