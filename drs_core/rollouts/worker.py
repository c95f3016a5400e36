"""What runs inside a pool's worker process."""

from __future__ import annotations

import os
import signal
import traceback
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

from drs_core.accelerator import make_runner
from drs_core.episode import Episode
from drs_core.errors import DrsError
from drs_core.rollouts.task import run_task


class Answer(NamedTuple):
    """What a worker sends: that it is ready (no task), an episode, or why there is none.

    exit_status is that of a DrsError; None with an error means a bug, and the error is its traceback.
    """

    task: int | None = None
    episode: Episode | None = None
    error: str | None = None
    exit_status: int | None = None


def work(shared_theta: Any, connection: Connection) -> None:
    """Take an agent and a backend, then tasks until the other end closes; theta (d,) float32 is in shared memory."""
    # Ctrl-C reaches the whole process group; the parent decides what it means
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, 1)
    theta = np.frombuffer(shared_theta, dtype=np.float32)
    index: int | None = None
    try:
        agent, backend = connection.recv()
        runner = make_runner(agent, backend)
        connection.send(Answer())
        while True:
            index, task = connection.recv()
            connection.send(Answer(index, run_task(runner, theta, task)))
    except (EOFError, BrokenPipeError):
        return
    except DrsError as error:
        _send(connection, Answer(index, error=str(error), exit_status=error.exit_status))
    except Exception:
        _send(connection, Answer(index, error=traceback.format_exc()))


def _send(connection: Connection, answer: Answer) -> None:
    try:
        connection.send(answer)
    except BrokenPipeError:
        pass
