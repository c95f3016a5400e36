"""What the tuner and the policy say on /diagnostics, once a second."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from drs_interfaces.msg import PolicyStatus, TuningProgress
from rclpy.node import Node

PERIOD_S = 1.0


def tuning_status(progress: TuningProgress, simulators: int) -> DiagnosticStatus:
    """ERROR for a failed run, WARN for one that nobody works on, else OK."""
    level = DiagnosticStatus.OK
    if progress.state == TuningProgress.FAILED:
        level = DiagnosticStatus.ERROR
    elif progress.state == TuningProgress.RUNNING and not simulators:
        level = DiagnosticStatus.WARN
    values = {
        "simulators": simulators,
        "update": f"{progress.update} of {progress.updates}",
        "output": progress.output,
        "rollouts per second": f"{progress.rollouts_per_second:.1f}",
    }
    return _status(level, "tuning", progress.message, values)


def policy_status(status: PolicyStatus, figures: Mapping[str, str]) -> DiagnosticStatus:
    """ERROR for a fault, WARN where the last observation was refused or the arm is held, else OK."""
    level = DiagnosticStatus.OK
    if status.state == PolicyStatus.FAULT:
        level = DiagnosticStatus.ERROR
    elif status.state in (PolicyStatus.REFUSING, PolicyStatus.HOLDING):
        level = DiagnosticStatus.WARN
    values = {
        "agent": status.agent,
        "answered": status.answered,
        "refused": status.refused,
        "latency [ms]": f"{1e3 * status.latency_s:.2f}",
        **figures,
    }
    return _status(level, "policy", status.message, values)


def _status(level: bytes, name: str, message: str, values: dict[str, object]) -> DiagnosticStatus:
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, values=pairs)


class Diagnostics:
    """Publishes a status; `describe` makes it, None for nothing to say."""

    def __init__(self, node: Node, describe: Callable[[], DiagnosticStatus | None]) -> None:
        """Begin at once."""
        self._node, self._describe = node, describe
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        node.create_timer(PERIOD_S, self._publish)

    def _publish(self) -> None:
        status = self._describe()
        if status is None:
            return
        status.name = f"{self._node.get_fully_qualified_name()}: {status.name}"
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
