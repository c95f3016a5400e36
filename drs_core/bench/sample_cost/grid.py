"""All searches, each in a process of its own at a time: whatever ends them, the same command goes on."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait

from drs_core.bench.sample_cost.agents import Subject
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.job import Job
from drs_core.bench.sample_cost.methods import chosen


def jobs(config: SampleCostConfig, subjects: Sequence[Subject]) -> list[Job]:
    """Seed by seed, so that an early end leaves something of everything."""
    return [
        Job(subject.agent, subject.goal, entry, seed, min(config.rollouts, entry.rollouts), subject.backend, path)
        for seed in range(config.seeds)
        for name, entry in chosen(config.methods).items()
        for subject in subjects
        for path in [config.output / subject.name / name / f"{seed}.jsonl"]
    ]


def run_jobs(work: Sequence[Job], config: SampleCostConfig, observe: Callable[[Job, int], None]) -> None:
    """Bring each to its end, or as far as the time lets it.

    `observe` is told of each that has its turn behind it, and how many have.

    Raises:
        DrsError: a record cannot be written or read, or an episode failed; the others' records are kept.
    """
    until = None if config.hours is None else time.monotonic() + 3600.0 * config.hours
    pool = ProcessPoolExecutor(config.workers, multiprocessing.get_context("spawn"), _deaf_to_interrupts)
    try:
        running: dict[Future[bool], Job] = {pool.submit(job.run, until): job for job in work}
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                future.result()
                job = running.pop(future)
                observe(job, len(work) - len(running))
    except BaseException:
        # Ctrl-C and errors end it now: a record is whole or absent
        for process in list((pool._processes or {}).values()):
            process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _deaf_to_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
