"""What the tuner says on /diagnostics, once a second."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from drs_interfaces.msg import TuningProgress
from rclpy.node import Node

PERIOD_S = 1.0


def level(state: int, simulators: int) -> bytes:
    """ERROR for a failed run, WARN for one that nobody works on, else OK."""
    if state == TuningProgress.FAILED:
        return DiagnosticStatus.ERROR
    if state == TuningProgress.RUNNING and not simulators:
        return DiagnosticStatus.WARN
    return DiagnosticStatus.OK


class Diagnostics:
    """Publishes the newest progress as a diagnostic status."""

    def __init__(self, node: Node, newest: Callable[[], TuningProgress], simulators: Callable[[], int]) -> None:
        """Begin at once."""
        self._node, self._newest, self._simulators = node, newest, simulators
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        node.create_timer(PERIOD_S, self._publish)

    def _publish(self) -> None:
        progress, simulators = self._newest(), self._simulators()
        values = {
            "simulators": simulators,
            "update": f"{progress.update} of {progress.updates}",
            "output": progress.output,
            "rollouts per second": f"{progress.rollouts_per_second:.1f}",
        }
        status = DiagnosticStatus(
            level=level(progress.state, simulators),
            name=f"{self._node.get_fully_qualified_name()}: tuning",
            message=progress.message,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
