"""Tells the graph how a run goes: a latched topic, an action's feedback, the log."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from drs_interfaces.msg import TuningProgress
from rclpy.node import Node

from drs.qos import LATCHED
from drs.tuner_parameters import Job
from drs_core.backing_off import said

_NUMBERS = (
    "alpha", "sigma", "objective_mean", "objective_std", "return_mean", "return_std", "failure_percent",
    "step_norm", "rollouts_per_second", "wall_s",
)  # fmt: skip


class Progress:
    """The topic tuning/progress; also the observer of a run."""

    def __init__(self, node: Node, simulators: Callable[[], int]) -> None:
        """`simulators` counts those that take part."""
        self._node, self._simulators = node, simulators
        self._publisher = node.create_publisher(TuningProgress, "tuning/progress", LATCHED)
        self.message = TuningProgress(message="Nothing is being tuned.")
        self._feedback: Callable[[TuningProgress], None] | None = None
        self._publish()

    def begin(self, job: Job, done: int, feedback: Callable[[TuningProgress], None] | None) -> None:
        """A run begins, or goes on after `done` updates; `feedback` gets every update's message."""
        updates = job.config.search.updates
        self._feedback = feedback
        self.message = TuningProgress(
            state=TuningProgress.RUNNING, agent=job.name, output=str(job.output), update=done, updates=updates
        )
        self.say(TuningProgress.RUNNING, f"Tuning {job.name} in {job.output}: {done} of {updates} updates done.")

    def say(self, state: int, sentence: str) -> None:
        """Change the state, and say it in the log too."""
        self.message.state, self.message.message = state, sentence
        if state not in (TuningProgress.RUNNING, TuningProgress.PAUSED):
            self.message.next = ""
        logger = self._node.get_logger()
        # two calls: rclpy refuses another severity from one place
        if state == TuningProgress.FAILED:
            logger.error(sentence)
        else:
            logger.info(sentence)
        self._publish()

    def announce(self, sentence: str) -> None:
        """Say what moves next; the state stays."""
        self.message.next = sentence
        self._node.get_logger().info(sentence)
        self._publish()

    def paused(self, sentence: str) -> None:
        """Say that nothing moves."""
        self.say(TuningProgress.PAUSED, sentence)

    def going_on(self, sentence: str) -> None:
        """Say that a pause is over."""
        self.say(TuningProgress.RUNNING, sentence)

    def warn(self, sentence: str) -> None:
        """Say in the log what a person should look at."""
        self._node.get_logger().warning(sentence)

    def on_rollouts(self, update: int, done: int, total: int) -> None:
        """Updates are fine enough for a topic."""

    def on_update(self, record: dict[str, Any]) -> None:
        """Show an update."""
        if went_back := said(record):
            self.warn(went_back)
        message = self.message
        message.update = record["update"]
        for name in _NUMBERS:
            setattr(message, name, float(record[name]))
        success = record["success_percent"]
        message.success_percent = math.nan if success is None else success
        self.say(
            TuningProgress.RUNNING,
            f"update {message.update}/{message.updates}: objective {message.objective_mean:.2f}, return "
            f"{message.return_mean:.2f}, {message.rollouts_per_second:.1f} rollouts/s "
            f"on {self._simulators()} simulators",
        )
        if self._feedback:
            self._feedback(message)

    def on_evaluation(self, record: dict[str, Any]) -> None:
        """Say an evaluation."""
        self._node.get_logger().info(
            f"evaluation after {record['update']}: return {record['return_mean']:.2f}, "
            f"objective {record['objective_mean']:.2f} in {record['episodes']} episodes"
        )

    def _publish(self) -> None:
        self.message.header.stamp = self._node.get_clock().now().to_msg()
        self.message.simulators = self._simulators()
        self._publisher.publish(self.message)
