"""A file of JSON lines that a crash can only shorten: append with fsync, and cut back to a known state."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from drs_core.errors import DrsError, UsageError
from drs_core.files import parse_json, read_bounded, write_atomically

MAX_BYTES = 2**30


def append(path: Path, record: dict[str, Any]) -> None:
    """Add one record and wait until it is on disk.

    Raises:
        DrsError: it cannot be written.
    """
    line = _text([record])
    try:
        with open(path, "a", encoding="utf-8") as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise DrsError(f"Cannot write {path}: {error.strerror}. The run is kept up to its last update.") from error


def read(path: Path, counter: str = "update") -> list[dict[str, Any]]:
    """Every whole record; what follows the last line end was cut off by a crash and is left out.

    Raises:
        UsageError: a whole line is not a JSON object with the counter.
    """
    if not path.exists():
        return []
    whole, _, _ = read_bounded(path, MAX_BYTES).rpartition(b"\n")
    records = [parse_json(line, f"A line of {path}") for line in whole.split(b"\n") if line]
    if not all(isinstance(record, dict) and isinstance(record.get(counter), int) for record in records):
        raise UsageError(f"A line of {path} is not a record: it has no whole number {counter!r}.")
    return records


def cut_back(path: Path, last: int, counter: str = "update") -> None:
    """Keep the records whose counter is at most `last`, and no half-written line."""
    if not path.exists():
        return
    kept = [record for record in read(path, counter) if record[counter] <= last]
    if _text(kept).encode() != read_bounded(path, MAX_BYTES):
        write(path, kept)


def write(path: Path, records: Iterable[dict[str, Any]]) -> None:
    """Put these records in the place of all that are there.

    Raises:
        DrsError: it cannot be written; what was there is untouched.
    """
    write_atomically(path, _text(records).encode())


def _text(records: Iterable[dict[str, Any]]) -> str:
    return "".join(json.dumps(record, allow_nan=False) + "\n" for record in records)
