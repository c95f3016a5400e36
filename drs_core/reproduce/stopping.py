"""When a row's run has had enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drs_core.tuning import Observer, Record

COMPLETE, UPDATES, PATIENCE, UNFINISHED = "schedule", "updates", "patience", "unfinished"


def stalled(evaluations: Sequence[Record], patience: int) -> bool:
    """Whether the newest evaluation is `patience` updates or more past the first that none has topped."""
    if not patience or not evaluations:
        return False
    best = max(evaluations, key=lambda record: record["objective_mean"])
    return bool(evaluations[-1]["update"] - best["update"] >= patience)


def reason(done: int, schedule: int, updates: int, evaluations: Sequence[Record], patience: int) -> str:
    """Why a run with `done` updates ended, or UNFINISHED."""
    if done >= schedule:
        return COMPLETE
    if done >= updates:
        return UPDATES
    return PATIENCE if stalled(evaluations, patience) else UNFINISHED


class Enough(Exception):
    """The run is to stop here; its folder is whole."""


class Stopper:
    """Watches a run and ends it: after an update where time is over, after an evaluation where it has stalled."""

    def __init__(self, watcher: Observer, late: Callable[[], bool], stalled: Callable[[], bool]) -> None:
        """All is passed on to `watcher`."""
        self._watcher, self._late, self._stalled = watcher, late, stalled
        self.on_rollouts = watcher.on_rollouts

    def on_update(self, record: Record) -> None:
        """Raise Enough where it is late."""
        self._watcher.on_update(record)
        if self._late():
            raise Enough

    def on_evaluation(self, record: Record) -> None:
        """Raise Enough where the run has stalled."""
        # the rollouts beside it are of the next update; only for a run's end are they worth losing
        self._watcher.on_evaluation(record)
        if self._stalled():
            raise Enough
