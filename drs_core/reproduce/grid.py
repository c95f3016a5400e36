"""All rows: one after the other, or in turns where time is short."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

from drs_core.errors import UsageError
from drs_core.reproduce.config import ReproduceConfig
from drs_core.reproduce.job import Job, Watcher
from drs_core.reproduce.lookup import NoAgentError, find
from drs_core.reproduce.paper import PaperRow
from drs_core.reproduce.stopping import UNFINISHED

RESERVE = 1.5
"""Time kept for a final evaluation, over that of the baseline's: a better agent often lives longer."""


class Observer(Watcher, Protocol):
    """Whoever watches a reproduction."""

    def on_row(self, job: Job) -> None:
        """A row has its turn."""
        ...


def prepare(rows: Sequence[PaperRow], config: ReproduceConfig) -> tuple[list[Job], dict[str, str]]:
    """The rows that have an agent that can be read, and why the others are skipped, by name.

    Raises:
        UsageError: no row has an agent that can be read, or what a folder holds does not fit what is asked.
    """
    jobs, skipped = [], dict[str, UsageError]()
    for row in rows:
        try:
            baseline = find(row, config.agents)
        except UsageError as why:
            skipped[row.name] = why
            continue
        jobs.append(Job(row, baseline, config))
    if not jobs:
        # a damaged agent is the more likely mistake
        told = min(skipped.values(), key=lambda why: isinstance(why, NoAgentError))
        raise UsageError(
            f"None of the {len(rows)} rows has an agent that can be read. {told} "
            "Give --agents a folder of the rl-zoo, which has a2c/HopperBulletEnv-v0_1 and so on."
        )
    return jobs, {name: str(why) for name, why in skipped.items()}


def run_grid(
    jobs: Sequence[Job], hours: float | None, observer: Observer, clock: Callable[[], float] = time.monotonic
) -> None:
    """Bring every row to its end, or in `hours` every row as far as it gets: whoever is behind has its turn.

    A turn ends at the next evaluation, or when the row's equal share of the time left is over; a row's first turn
    is one update, since what it costs is not known before. The update under way is finished, and time is kept for
    the final evaluations.
    """
    end = None if hours is None else clock() + 3600.0 * hours
    unfinished = sorted((job for job in jobs if not job.whole()), key=lambda job: job.done())
    while unfinished and (end is None or _left(end, clock(), jobs) > 0):
        for place, job in enumerate(unfinished):
            until = None
            if end is not None:
                left = _left(end, clock(), jobs)
                if left <= 0:
                    break
                until = clock() + (left / (len(unfinished) - place) if job.done() else 0.0)
            observer.on_row(job)
            job.work(observer, until)
        unfinished = [job for job in unfinished if job.stop_reason() == UNFINISHED]
        unfinished.sort(key=lambda job: job.done())
    for job in jobs:
        job.conclude(observer)


def _left(end: float, now: float, jobs: Sequence[Job]) -> float:
    """Seconds for tuning: what is left without the evaluations that are still to come."""
    return end - now - sum(RESERVE * job.evaluation_s() for job in jobs)
