"""All searches, each in a process of its own at a time: whatever ends them, the same command goes on."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from drs_core.bench.sample_cost.agents import Subject
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.job import Job
from drs_core.bench.sample_cost.methods import chosen
from drs_core.bench.sample_cost.worker import begin_worker
from drs_core.errors import DrsError
from drs_core.files import lock_folder, make_folder


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
        UsageError: another process works in the output folder, or records are damaged or of another search.
        DrsError: a method's library is not installed, and nothing has run; or a record cannot be written, an
            episode failed, or a process was killed; the others' records are kept.
    """
    until = None if config.hours is None else time.monotonic() + 3600.0 * config.hours
    make_folder(config.output)
    with lock_folder(config.output):
        for job in work:
            job.check_library()
        try:
            _run(work, config.workers, until, observe)
        except BrokenProcessPool as error:
            raise DrsError(
                "A process that ran a search was killed, perhaps for want of memory. The records are kept and the same "
                "command goes on; fewer --workers need less memory."
            ) from error


def _run(work: Sequence[Job], workers: int, until: float | None, observe: Callable[[Job, int], None]) -> None:
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), begin_worker)
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
