"""Rollouts in persistent local processes: theta in shared memory, perturbations drawn in the worker."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import RawArray
from typing import cast

import numpy as np

from drs_core.accelerator import PLAIN, PYTHON
from drs_core.agent import Agent
from drs_core.environments import is_proved
from drs_core.episode import Episode
from drs_core.errors import DrsError, UsageError
from drs_core.policy import Float32
from drs_core.rollouts.task import Progress, Task
from drs_core.rollouts.worker import Answer, work

MAX_WORKERS = 256
MOST_DEATHS = 3
"""A task that kills this many workers is reported instead of tried again."""


def tasks_to_give(held: int, waiting: int, workers: int) -> int:
    """How many of `waiting` tasks a worker that holds `held` gets now.

    Two at a time, so that both sides of a direction, which stand side by side, meet in one worker and
    the direction is drawn once; while it runs the last of them the next wait beside it. Towards the
    end only who has nothing gets one, so that all end together.
    """
    if waiting >= 4 * workers:
        return 2 if held < 2 else 0
    return min(waiting, 1) if held == 0 else 0


class WorkerError(DrsError):
    """A worker failed with an exception of its own; the message holds its traceback."""

    longest = 20_000


class _Worker:
    def __init__(self, shared_theta: object) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(
            target=work, args=(shared_theta, theirs), daemon=True, name="drs-worker"
        )
        with _one_thread(), _deaf_to_interrupts():
            self.process.start()
        theirs.close()
        self.tasks: deque[int] = deque()

    def instruct(self, agent: Agent, backend: str) -> None:
        """Say what to run; not as arguments, which a process that dies as it starts would never take."""
        try:
            self.connection.send((agent, backend))
        except (BrokenPipeError, ConnectionResetError):
            pass  # receiving will say so

    def stop(self) -> None:
        self.connection.close()
        self.process.kill()
        self.process.join()


class ProcessPool:
    """The protocol `Rollouts` over local worker processes.

    A worker that dies is replaced and its tasks are run again, with the same result. Use it as a
    context manager or call close().
    """

    def __init__(self, agent: Agent, workers: int, backend: str = "python") -> None:
        """Start the workers and wait until each has made its environment.

        Raises:
            UsageError: the number of workers is out of range.
            DrsError: a worker could not make the environment.
        """
        if not 1 <= workers <= MAX_WORKERS:
            raise UsageError(f"workers is {workers}; allowed are 0 to {MAX_WORKERS}.")
        # what there is to say is said here, once, and not by every worker
        fast = backend != PYTHON or is_proved(agent.environment)
        self._agent, self._backend = agent, backend if fast else PLAIN
        self._shared_theta = RawArray("f", len(agent.theta))
        self._workers = [_Worker(self._shared_theta) for _ in range(workers)]
        try:
            for worker in self._workers:
                worker.instruct(agent, self._backend)
            for worker in self._workers:
                self._receive(worker)
        except (EOFError, ConnectionResetError) as error:
            self.close()
            raise DrsError("A worker process ended before it was ready; is there enough memory?") from error
        except BaseException:
            self.close()
            raise

    @property
    def pids(self) -> list[int]:
        """Process ids of the workers."""
        return [cast(int, worker.process.pid) for worker in self._workers]

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """Every task's episode, in the order of tasks.

        Raises:
            DrsError: an episode failed, or its workers died again and again. The pool is closed then.
        """
        np.frombuffer(self._shared_theta, dtype=np.float32)[:] = theta
        episodes: list[Episode | None] = [None] * len(tasks)
        waiting, deaths, done = deque(range(len(tasks))), [0] * len(tasks), 0
        try:
            while done < len(tasks):
                for worker in self._workers:
                    self._hand_out(worker, waiting, tasks)
                busy: dict[Connection, int] = {w.connection: i for i, w in enumerate(self._workers) if w.tasks}
                for ready in wait(list(busy)):
                    place = busy[cast(Connection, ready)]
                    worker = self._workers[place]
                    try:
                        answer = self._receive(worker)
                    except (EOFError, ConnectionResetError):
                        self._replace(place, waiting, deaths, tasks)
                        continue
                    if answer.task is not None:
                        worker.tasks.remove(answer.task)
                        episodes[answer.task] = answer.episode
                        done += 1
                        if progress:
                            progress(done)
        except BaseException:
            # tasks are still under way, and their answers would be taken for those of the next call
            self.close()
            raise
        return cast(list[Episode], episodes)

    def close(self) -> None:
        """End the workers, whatever they are doing."""
        for worker in self._workers:
            worker.stop()
        self._workers = []

    def __enter__(self) -> ProcessPool:
        """The pool itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def _hand_out(self, worker: _Worker, waiting: deque[int], tasks: Sequence[Task]) -> None:
        for _ in range(tasks_to_give(len(worker.tasks), len(waiting), len(self._workers))):
            index = waiting.popleft()
            worker.tasks.append(index)
            try:
                worker.connection.send((index, tasks[index]))
            except (BrokenPipeError, ConnectionResetError):
                return  # dead: receiving will say so, and replace it

    def _receive(self, worker: _Worker) -> Answer:
        answer: Answer = worker.connection.recv()
        if answer.error is not None:
            if answer.exit_status is not None:
                raise (UsageError if answer.exit_status == UsageError.exit_status else DrsError)(answer.error)
            raise WorkerError(f"A worker process failed; this is its report:\n{answer.error}")
        return answer

    def _replace(self, place: int, waiting: deque[int], deaths: list[int], tasks: Sequence[Task]) -> None:
        worker = self._workers[place]
        worker.process.join()
        code = worker.process.exitcode
        if worker.tasks:
            first = worker.tasks[0]
            deaths[first] += 1
            if deaths[first] >= MOST_DEATHS:
                raise DrsError(
                    f"The episode with seed {tasks[first].seed} ended its worker process {MOST_DEATHS} times "
                    f"(exit status {code}); is there enough memory?"
                )
        waiting.extendleft(reversed(worker.tasks))
        worker.stop()
        self._workers[place] = _Worker(self._shared_theta)
        self._workers[place].instruct(self._agent, self._backend)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Children start without SIGINT: Ctrl-C reaches the whole group, and the parent decides what it means."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Children start with one BLAS thread each: more would only fight for the cores and take memory."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
