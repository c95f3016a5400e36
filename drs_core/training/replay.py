"""The replay buffer on disk: rows in the order they were added, each written once.

A buffer of a million transitions is hundreds of megabytes; a checkpoint writes only the rows that came
since the one before, as one more file. With hindsight an episode can be used only when it is whole, so
that the rows of the unfinished one stay out; a resumed training begins with a new episode.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError

Arrays = dict[str, NDArray[Any]]

_COLUMNS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts", "ep_start")


@dataclass(frozen=True)
class Segment:
    """Rows first .. first + rows - 1, counted from the first that was ever added, in one file."""

    file: str
    first: int
    rows: int

    @property
    def end(self) -> int:
        """One past the last row."""
        return self.first + self.rows


def usable_rows(buffer: Any, added: int) -> int:
    """How many of the rows added so far a resumed training can use."""
    if not hasattr(buffer, "ep_start"):
        return added
    return added - int(buffer.pos - buffer._current_ep_start[0]) % int(buffer.buffer_size)


def still_needed(segments: Iterable[Segment], buffer: Any, end: int) -> list[Segment]:
    """The segments of which the buffer holds a row when `end` rows were added."""
    return [segment for segment in segments if segment.end > end - buffer.buffer_size]


def new_rows(buffer: Any, kept_end: int, end: int) -> tuple[int, Arrays]:
    """The rows after `kept_end` that are still there, and the number of the first: column -> (rows, 1, …)."""
    first = max(kept_end, end - buffer.buffer_size)
    rows = np.arange(first, end) % buffer.buffer_size
    return first, {name: column[rows] for name, column in _columns(buffer)}


def restore(buffer: Any, segments: list[Segment], end: int, read: Callable[[str], Arrays]) -> None:
    """Fill an empty buffer with the rows of the segments, `end` having been added.

    Raises:
        UsageError: a segment does not fit the buffer.
    """
    size, columns = int(buffer.buffer_size), dict(_columns(buffer))
    for segment in segments:
        arrays = read(segment.file)
        # of a file that reaches back beyond the buffer only the end is wanted
        skip = max(0, end - size - segment.first)
        rows = np.arange(segment.first + skip, segment.end) % size
        for name, column in columns.items():
            values = arrays.get(name)
            if values is None or values.dtype != column.dtype or values.shape != (segment.rows, *column.shape[1:]):
                raise UsageError(f"{segment.file} does not fit the replay buffer; it is not of this training.")
            column[rows] = values[skip:]
    buffer.pos, buffer.full = end % size, end >= size
    if hasattr(buffer, "ep_start"):
        buffer._current_ep_start[:] = buffer.pos
        _restore_lengths(buffer, max(0, end - size), end)


def _restore_lengths(buffer: Any, first: int, end: int) -> None:
    """Length of the episode that each row belongs to; 0 where its beginning was overwritten."""
    rows = np.arange(first, end) % buffer.buffer_size
    ends = np.flatnonzero(buffer.dones[rows, 0]) + 1
    lengths = np.diff(ends, prepend=0)
    if len(lengths) and buffer.ep_start[rows[0], 0] != rows[0]:
        row_lengths = np.repeat(np.concatenate([[0], lengths[1:]]), lengths)
    else:
        row_lengths = np.repeat(lengths, lengths)
    buffer.ep_length[:] = 0
    buffer.ep_length[rows[: len(row_lengths)], 0] = row_lengths


def _columns(buffer: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    for name in _COLUMNS:
        column = getattr(buffer, name, None)
        if isinstance(column, dict):
            for key in sorted(column):
                yield f"{name}.{key}", column[key]
        elif column is not None:
            yield name, column
