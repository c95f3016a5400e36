"""Which cluster, and what a task asks of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from drs_core.errors import UsageError, shown
from drs_core.plain_yaml import read_plain_yaml


@dataclass(frozen=True, kw_only=True)
class RayConfig:
    """Settings of rollouts on Ray.

    Attributes:
        address: of the cluster, such as ``auto`` or ``ray://host:10001``; None: that of the variable
            RAY_ADDRESS, or one that lives on this machine for as long as the run.
        cpus: of a cluster that is started here; None: all cores.
        cpus_per_task: processors that a task takes.
        resources: other resources that a task takes, by name, so that only some machines are used.
        runtime_env: files, packages and variables of the workers, as Ray's runtime environment.
        patience_s: time without any result after which the cluster is taken for unable [s].
    """

    address: str | None = None
    cpus: int | None = None
    cpus_per_task: float = 1.0
    resources: Mapping[str, float] = field(default_factory=dict)
    runtime_env: Mapping[str, Any] = field(default_factory=dict)
    patience_s: float = 120.0

    def __post_init__(self) -> None:
        """Raise UsageError where a value is not allowed."""
        if self.address is not None and not (isinstance(self.address, str) and self.address):
            raise UsageError(f"address is {shown(self.address)}; write auto, host:port or ray://host:port.")
        if self.cpus is not None and not (isinstance(self.cpus, int) and 1 <= self.cpus <= 1024):
            raise UsageError(f"cpus is {shown(self.cpus)}; allowed are whole numbers 1 to 1024.")
        for name, value, low, high in (
            ("cpus_per_task", self.cpus_per_task, 0.01, 1024.0),
            ("patience_s", self.patience_s, 1.0, 86_400.0),
            *((f"resources: {name}", value, 0.0, 1e6) for name, value in _mapping("resources", self.resources)),
        ):
            if not (isinstance(value, (int, float)) and math.isfinite(value) and low <= value <= high):
                raise UsageError(f"{name} is {shown(value)}; allowed are {low} to {high}.")
        _mapping("runtime_env", self.runtime_env)


def _mapping(name: str, value: Any) -> Any:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise UsageError(f"{name} is {shown(value)}; write names with values below it.")
    return value.items()


def read_ray_config(path: Path | None) -> RayConfig:
    """The settings of a YAML file, or the defaults.

    Raises:
        UsageError: the file is not of this layout, or a value is not allowed.
    """
    if path is None:
        return RayConfig()
    content, known = read_plain_yaml(path), [each.name for each in fields(RayConfig)]
    if not isinstance(content, dict) or not set(content) <= set(known):
        raise UsageError(f"{path} has {shown(content)}; known are {', '.join(known)}.")
    try:
        return RayConfig(**content)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error
