"""Adding to a search's file, which no other process writes meanwhile."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any

from drs_core import json_lines
from drs_core.bench.sample_cost.records import COUNTER, Record, read
from drs_core.errors import UsageError
from drs_core.files import make_folder, temporary_name, write_atomically


def begin(path: Path, head: Mapping[str, Any]) -> list[Record]:
    """The records so far, the head at least, with the file ready for more.

    Raises:
        UsageError: the file is of another search, damaged or a link.
        DrsError: it cannot be written.
    """
    if path.is_symlink():
        raise UsageError(f"{path} is a link, and nothing is written through it; put the file itself there.")
    for left in path.parent.glob(temporary_name(path)):
        # begun by a process that was killed
        left.unlink(missing_ok=True)
    records = read(path, head)
    # a line that was half written goes
    json_lines.cut_back(path, records[-1][COUNTER] if records else 0, COUNTER)
    if not records:
        make_folder(path.parent)
        add(path, records, dict(head))
    return records


def add(path: Path, records: list[Record], record: Record) -> None:
    """Add one to the records and their file: at the end, or a look after the update that it sees.

    Raises:
        DrsError: the file cannot be written.
    """
    place = bisect_right(records, record[COUNTER], key=itemgetter(COUNTER))
    records.insert(place, record)
    if place == len(records) - 1:
        json_lines.append(path, record)
    else:
        write_atomically(path, "".join(json.dumps(kept, allow_nan=False) + "\n" for kept in records).encode())
