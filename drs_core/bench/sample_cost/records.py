"""A search's file: a head, then updates and looks in order, every one checked before it is believed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drs_core import json_lines
from drs_core.errors import UsageError, shown

COUNTER = "rollouts"
MEND = "Delete the file: that search begins anew."

Record = dict[str, Any]


def read(path: Path, head: Mapping[str, Any]) -> list[Record]:
    """All whole records; none where the search has not begun.

    Raises:
        UsageError: the file is of another search, or damaged.
    """
    try:
        records = json_lines.read(path, COUNTER)
    except UsageError as error:
        raise UsageError(f"{error} {MEND}") from error
    if records and records[0] != head:
        raise UsageError(
            f"{path} is of another agent, goal, backend or setting: choose another --output, or delete the file, and "
            "that search begins anew."
        )
    done, looked = 0, False
    for line, record in enumerate(records[1:], 2):
        wrong = _wrong(record, done, looked)
        if wrong:
            raise UsageError(f"Line {line} of {path} is damaged: {wrong}. {MEND}")
        done, looked = record[COUNTER], "reached" in record
    return records


def _wrong(record: Record, done: int, looked: bool) -> str | None:
    """What is wrong with a record that follows `done` rollouts, and perhaps a look there."""
    counter = record[COUNTER]
    if record.keys() == {COUNTER, "objectives"}:
        objectives = record["objectives"]
        if not _finite(objectives) or not objectives:
            return f"objectives is {shown(objectives)}, not a list of finite numbers"
        wanted = done + len(objectives)
    elif record.keys() == {COUNTER, "reached", "shown", "returns"}:
        if not isinstance(record["reached"], bool):
            return f"reached is {shown(record['reached'])}, not true or false"
        if not _finite([record["shown"]]):
            return f"shown is {shown(record['shown'])}, not a finite number"
        if not _finite(record["returns"]):
            return f"returns is {shown(record['returns'])}, not a list of finite numbers"
        if looked:
            return f"it is a second look after {done} rollouts"
        wanted = done
    else:
        return f"it has the keys {shown(sorted(record))}, which neither an update nor a look has"
    if isinstance(counter, bool) or counter != wanted:
        return f"rollouts is {shown(counter)}, where {wanted} are done"
    return None


def _finite(values: Any) -> bool:
    return isinstance(values, list) and all(map(_is_finite, values))


def _is_finite(value: Any) -> bool:
    try:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer that is larger than any float
        return False
