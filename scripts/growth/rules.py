"""The tuner's own rules of handing out tasks, from its source, so that the model cannot drift from them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "ros_ws" / "src" / "drs" / "drs" / "dispatch.py"


@dataclass(frozen=True)
class Rules:
    """What drs.dispatch says.

    Attributes:
        batch_size: (tasks that wait, simulators, duration of an episode [s] or None) -> tasks of the next batch.
        is_late: (age of a call [s], expected duration [s]) -> whether another one should run it again.
        unfinished: (tasks, results) -> those without one.
        in_flight: calls at one simulator.
    """

    batch_size: Callable[[int, int, float | None], int]
    is_late: Callable[[float, float], bool]
    unfinished: Callable[[Sequence[int], Sequence[object | None]], list[int]]
    in_flight: int


def product_rules() -> Rules:
    """Those of this checkout; its dispatch.py needs no ROS 2, the package around it does."""
    spec = importlib.util.spec_from_file_location("growth_dispatch", SOURCE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return Rules(module.batch_size, module.is_late, module.unfinished, module.IN_FLIGHT)
