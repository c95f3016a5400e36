"""Node parameters as data: name, default, description and range of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node


@dataclass(frozen=True)
class Declared:
    """One parameter; `low` and `high` bound a number, `allowed` lists what a text may be."""

    name: str
    default: Any
    description: str
    low: float | None = None
    high: float | None = None
    allowed: tuple[str, ...] = ()
    dynamic: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """What `ros2 param describe` shows."""
        choices = f"one of {', '.join(self.allowed)}" if self.allowed else ""
        descriptor = ParameterDescriptor(
            description=self.description, additional_constraints=choices, read_only=not self.dynamic
        )
        if self.low is not None and self.high is not None and not isinstance(self.default, list):
            if isinstance(self.default, int):
                descriptor.integer_range = [IntegerRange(from_value=int(self.low), to_value=int(self.high), step=0)]
            else:
                descriptor.floating_point_range = [FloatingPointRange(from_value=self.low, to_value=self.high)]
        return descriptor


def declare(node: Node, parameters: Sequence[Declared]) -> dict[str, Any]:
    """Declare every parameter; returns the values in force.

    Raises:
        UsageError: a text is not one of those allowed, or a parameter is given that no node of drs has.
    """
    from drs_core.errors import UsageError
    from drs_core.node_parameters import check_given

    # rclpy shows what the command line and parameter files give nowhere else
    given = getattr(node, "_parameter_overrides", {})
    # what rclpy itself has declared by now is not ours to judge
    check_given((name for name in given if not node.has_parameter(name)), [p.name for p in parameters])
    values = {}
    for parameter in parameters:
        value = node.declare_parameter(parameter.name, parameter.default, parameter.descriptor()).value
        if parameter.allowed and value not in parameter.allowed:
            raise UsageError(
                f"The parameter {parameter.name} is {value!r}; allowed are {', '.join(map(repr, parameter.allowed))}."
            )
        values[parameter.name] = list(value) if isinstance(parameter.default, list) else value
    return values
