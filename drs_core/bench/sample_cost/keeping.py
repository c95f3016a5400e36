"""Adding to a search's file, which no other process writes meanwhile."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any

from drs_core import json_lines
from drs_core.bench.sample_cost.records import COUNTER, Record, read
from drs_core.files import clear_unfinished, make_folder, refuse_link


def begin(path: Path, head: Mapping[str, Any]) -> list[Record]:
    """The records so far, the head at least, with the file ready for more.

    Raises:
        UsageError: the file is of another search, damaged or a link.
        DrsError: it cannot be written.
    """
    # nor are the agent's and the method's folder: they lie in the one that was asked for
    for place in (path, path.parent, path.parent.parent):
        refuse_link(place)
    clear_unfinished(path)
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
        json_lines.write(path, records)
