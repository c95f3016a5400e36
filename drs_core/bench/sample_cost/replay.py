"""A search brought back by what it was told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from drs_core.bench.sample_cost.methods.method import Candidates, Float64, Method
from drs_core.bench.sample_cost.records import COUNTER, MEND, Record
from drs_core.errors import UsageError


def replay(method: Method, records: Sequence[Record], until: int, path: Path) -> Method:
    """The method, given at its start, after the updates among these records up to `until` rollouts.

    Raises:
        UsageError: the objectives of an update are not as many as it values; `path` names their file.
    """
    for record in records:
        if "objectives" in record and record[COUNTER] <= until:
            told = _Told(record["objectives"])
            if not told.is_all_of(method):
                raise UsageError(
                    f"The objectives in {path} up to {record[COUNTER]} rollouts are not as many as the search values. "
                    f"{MEND}"
                )
    return method


class _Told:
    """The objectives of an update, given out again to whoever values as many."""

    def __init__(self, objectives: Sequence[float]) -> None:
        self._left: Iterator[float] = iter(objectives)

    def is_all_of(self, method: Method) -> bool:
        """Update the method with them; whether it has valued neither more nor fewer."""
        try:
            method.update(self._recall)
        except _TooFewError:
            return False
        return next(self._left, None) is None

    def _recall(self, candidates: Candidates) -> Float64:
        wanted = sum(1 for _ in candidates)
        found = list(islice(self._left, wanted))
        if len(found) < wanted:
            # a method that is told fewer than it asked for would fail with words of its own
            raise _TooFewError
        return np.array(found, dtype=np.float64)


class _TooFewError(Exception):
    pass
