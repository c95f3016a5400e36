"""When a row's run has had enough."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

COMPLETE, UPDATES, PATIENCE, UNFINISHED = "schedule", "updates", "patience", "unfinished"


def stalled(evaluations: Sequence[dict[str, Any]], patience: int) -> bool:
    """Whether the newest evaluation is `patience` updates or more past the first that none has topped."""
    if not patience or not evaluations:
        return False
    best = max(evaluations, key=lambda record: record["objective_mean"])
    return bool(evaluations[-1]["update"] - best["update"] >= patience)


def reason(done: int, schedule: int, updates: int, evaluations: Sequence[dict[str, Any]], patience: int) -> str:
    """Why a run with `done` updates ended, or UNFINISHED."""
    if done >= schedule:
        return COMPLETE
    if done >= updates:
        return UPDATES
    return PATIENCE if stalled(evaluations, patience) else UNFINISHED
