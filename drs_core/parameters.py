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

from drs_core.errors import UsageError, shown
from drs_core.plain_yaml import read_plain_yaml

Convert = Callable[[Any], Any]


def _integer(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**63:
        raise ValueError("a whole number of 64 bits")
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
        raise ValueError("a finite number" + _mend(value))
    return float(value)


def _mend(value: Any) -> str:
    """What to say of a number that this version of YAML takes for a text, such as 1e-3; empty for anything else."""
    try:
        finite = isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        finite = False
    return "; YAML wants a point in it, as in 1.0e-3" if finite else ""


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
    "budget": _text,
    "reset_seconds": _number,
    "directions": _integer,
    "alpha": _pair,
    "sigma": _pair,
    "seed": _integer,
    "last_layer": _truth,
    "action_gains": _truth,
    "top": _integer,
    "paired_spread": _truth,
    "back_off": _truth,
    "evaluate_every": _integer,
    "evaluation_episodes": _integer,
    "stop_when_flat": _truth,
    "backend": _text,
    "attempts": _integer,
    "action_change_max": _number,
    # of a tuner node only; the command line reads the same files
    "agents_root": _text,
    "call_deadline_s": _number,
    "evaluation_patience_s": _number,
    "evaluation_seed": _integer,
    "observations": _text,
    "pause_each_update": _truth,
    "exit_when_done": _truth,
}
"""Parameters of a tuning run, by name; ranges are checked where they are used."""


def read_parameters(
    path: Path,
    node: str = "tuner_node",
    known: Mapping[str, Convert] = TUNER,
    elsewhere: Callable[[Any], bool] = lambda _: False,
) -> dict[str, Any]:
    """What a parameter file sets for a node: its own section, over the one for all nodes (``/**``).

    That one may also hold what other nodes have: what is `elsewhere` is passed over there.

    Raises:
        UsageError: the file is not of this layout, or a key is unknown or of another type.
    """
    content = read_plain_yaml(path)
    if not isinstance(content, dict) or not all(isinstance(body, dict) for body in content.values()):
        raise UsageError(f"{path} does not hold node names with ros__parameters below.")
    sections = [section for section in ("/**", node, f"/{node}") if section in content]
    if not sections:
        raise UsageError(f"{path} has no section '/**' or {node!r}, only {shown(list(content))}.")
    values: dict[str, Any] = {}
    for section in sections:
        body = content[section]
        if list(body) != ["ros__parameters"] or not isinstance(body["ros__parameters"], dict):
            raise UsageError(
                f"{path}: the section {section!r} has {shown(list(body))}, not one mapping ros__parameters."
            )
        for key, value in body["ros__parameters"].items():
            if section == "/**" and key not in known and elsewhere(key):
                continue
            values[key] = _converted(path, key, value, known)
    return values


def _converted(path: Path, key: Any, value: Any, known: Mapping[str, Convert]) -> Any:
    if key not in known:
        raise UsageError(f"{path}: the parameter {shown(key)} is unknown; known are {', '.join(known)}.")
    try:
        return known[key](value)
    except ValueError as error:
        raise UsageError(f"{path}: the parameter {key!r} is {shown(value)}, but must be {error}.") from error
