"""Parameter files: the ROS 2 layout, read with every key, type and range checked.

/**:
  ros__parameters:
    updates: 20
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from drs_core.errors import UsageError
from drs_core.files import read_bounded

MAX_BYTES = 2**20

Convert = Callable[[Any], Any]


def _integer(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError("a whole number")
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError("a finite number")
    return float(value)


def _pair(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError("a list of two numbers, [first, last]")
    return _number(value[0]), _number(value[1])


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("a text")
    return value


def _truth(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


TUNER: Mapping[str, Convert] = {
    "agent": _text,
    "autostart": _truth,
    "output": _text,
    "objective": _text,
    "smoothness_weight": _number,
    "updates": _integer,
    "directions": _integer,
    "alpha": _pair,
    "sigma": _pair,
    "seed": _integer,
    "last_layer": _truth,
    "evaluate_every": _integer,
    "evaluation_episodes": _integer,
    # of a tuner node only; the command line reads the same files
    "agents_root": _text,
    "call_deadline_s": _number,
    "evaluation_patience_s": _number,
    "evaluation_seed": _integer,
    "exit_when_done": _truth,
}
"""Parameters of a tuning run, by name; ranges are checked where they are used."""


def read_parameters(path: Path, node: str = "tuner_node", known: Mapping[str, Convert] = TUNER) -> dict[str, Any]:
    """What a parameter file sets for a node: its own section, over the one for all nodes (``/**``).

    Raises:
        UsageError: the file is not of this layout, or a key is unknown or of another type.
    """
    try:
        content = yaml.safe_load(read_bounded(path, MAX_BYTES))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise UsageError(f"{path} is not a readable YAML file ({_short(error)}).") from error
    if not isinstance(content, dict):
        raise UsageError(f"{path} does not hold node names with ros__parameters below.")
    values: dict[str, Any] = {}
    for section in ("/**", node, f"/{node}"):
        if section not in content:
            continue
        body = content[section]
        if not isinstance(body, dict) or not isinstance(body.get("ros__parameters"), dict):
            raise UsageError(f"{path}: the section {section!r} has no mapping ros__parameters.")
        for key, value in body["ros__parameters"].items():
            values[key] = _converted(path, key, value, known)
    return values


def _converted(path: Path, key: Any, value: Any, known: Mapping[str, Convert]) -> Any:
    if key not in known:
        raise UsageError(f"{path}: the parameter {str(key)[:60]!r} is unknown; known are {', '.join(known)}.")
    try:
        return known[key](value)
    except ValueError as error:
        raise UsageError(f"{path}: the parameter {key!r} is {str(value)[:60]!r}, but must be {error}.") from error


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:160]
