"""Progress on standard error: a live bar on a terminal, a line an update otherwise."""

from __future__ import annotations

from types import TracebackType
from typing import Any, TypeVar

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from drs_core.backing_off import said

Shown = TypeVar("Shown", bound="Bars")


class Bars:
    """Bars on a terminal, nothing otherwise, while it is used as a context manager."""

    def __init__(self, console: Console, *columns: ProgressColumn) -> None:
        """The columns are rich's own unless given."""
        self._progress = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)

    def __enter__(self: Shown) -> Shown:
        """Start the bars."""
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the bars."""
        self._progress.stop()


class TuningProgress(Bars):
    """Watches a run; use it as a context manager."""

    def __init__(self, console: Console, updates: int) -> None:
        """`updates` is the number that the run will end at."""
        super().__init__(
            console, TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        )
        self._console, self._updates = console, updates
        self._total = self._progress.add_task("updates", total=updates)
        self._rollouts = self._progress.add_task("rollouts of this update", total=None)

    def on_rollouts(self, update: int, done: int, total: int) -> None:
        """Move the bars."""
        self._progress.update(self._rollouts, completed=done, total=total)
        self._progress.update(self._total, completed=update - 1 + done / total)

    def on_update(self, record: dict[str, Any]) -> None:
        """Print a line."""
        self._progress.update(self._total, completed=record["update"])
        if went_back := said(record):
            self._console.print(went_back, highlight=False)
        success = "" if record["success_percent"] is None else f", success {record['success_percent']:.0f} %"
        self._console.print(
            f"update {record['update']}/{self._updates}: objective {record['objective_mean']:.2f} "
            f"+- {record['objective_std']:.2f}, return {record['return_mean']:.2f}, "
            f"failure {record['failure_percent']:.0f} %{success}, {record['rollouts_per_second']:.1f} rollouts/s",
            highlight=False,
        )

    def on_evaluation(self, record: dict[str, Any]) -> None:
        """Print a line."""
        self._console.print(
            f"evaluation after {record['update']}: return {record['return_mean']:.2f} +- {record['return_std']:.2f}, "
            f"objective {record['objective_mean']:.2f} in {record['episodes']} episodes",
            highlight=False,
        )


class EpisodeProgress(Bars):
    """A bar of episodes on a terminal, nothing otherwise; use it as a context manager."""

    def __init__(self, console: Console, label: str, episodes: int) -> None:
        """`label` says what is evaluated."""
        super().__init__(console)
        self._task: TaskID = self._progress.add_task(escape(label), total=episodes)

    def __call__(self, done: int) -> None:
        """`done` episodes are done."""
        self._progress.update(self._task, completed=done)
