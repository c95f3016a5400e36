"""Progress of a reproduction on standard error: bars on a terminal, a line an evaluation."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn

from drs_core.reporting.progress import Bars
from drs_core.reproduce.job import Job
from drs_core.rollouts import Progress


class ReproduceProgress(Bars):
    """Watches a reproduction; use it as a context manager."""

    def __init__(self, console: Console, jobs: Sequence[Job], updates: int) -> None:
        """`updates` is what each row ends at."""
        super().__init__(
            console, TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        )
        self._console, self._started, self._name, self._updates = console, time.monotonic(), "", updates
        self._rows = self._progress.add_task("updates of all rows", total=len(jobs) * updates)
        self._part = self._progress.add_task("", total=None)
        self._done = {job.row.name: min(job.done(), updates) for job in jobs}
        self._move()

    def on_row(self, job: Job) -> None:
        """A row has its turn."""
        self._name = job.row.name
        self._say(f"{job.done()} of {self._updates} updates done, backend {job.backend}")

    def on_evaluate(self, row: str, stage: str, episodes: int) -> Progress:
        """Its episodes move the lower bar."""
        self._name = row
        self._say(f"evaluation {stage}, {episodes} episodes")
        return lambda done: self._part_of(f"{row}: evaluation {stage}", done, episodes)

    def on_other_versions(self, sentence: str) -> None:
        """Print it in one line."""
        self._console.out(sentence)

    def on_rollouts(self, update: int, done: int, total: int) -> None:
        """The rollouts of an update move the lower bar."""
        self._part_of(f"{self._name}: rollouts of update {update}", done, total)

    def on_update(self, record: dict[str, Any]) -> None:
        """Move the upper bar."""
        self._done[self._name] = record["update"]
        self._move()

    def on_evaluation(self, record: dict[str, Any]) -> None:
        """Print a line."""
        self._say(
            f"after {record['update']} updates: objective {record['objective_mean']:.2f}, "
            f"return {record['return_mean']:.2f} +- {record['return_std']:.2f}, "
            f"failure {record['failure_percent']:.0f} %"
        )

    def _say(self, text: str) -> None:
        self._console.print(f"{time.monotonic() - self._started:5.0f} s: {self._name}: {text}")

    def _part_of(self, text: str, done: int, total: int) -> None:
        self._progress.update(self._part, description=escape(text), completed=done, total=total)

    def _move(self) -> None:
        self._progress.update(self._rows, completed=sum(self._done.values()))
