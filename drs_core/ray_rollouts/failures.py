"""What a task gave in place of its episodes, as a sentence."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from drs_core.errors import DrsError, UsageError
from drs_core.ray_rollouts.messages import Answer

_ESCAPES = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
_LONGEST = 300


def plain(error: BaseException) -> str:
    """An error's text in one line, without colours; of a traceback, what was raised."""
    lines = [line.strip() for line in _ESCAPES.sub("", str(error)).splitlines() if line.strip()]
    traced = any(line.startswith("Traceback") for line in lines)
    return " ".join(lines[-1:] if traced else lines)[:_LONGEST] or type(error).__name__


def explained(error: Any, exceptions: Any, retries: int) -> str:
    """A sentence on a task's RayError; `exceptions` is ``ray.exceptions``."""
    lost = (
        exceptions.LocalRayletDiedError,
        exceptions.NodeDiedError,
        exceptions.ObjectLostError,
        exceptions.OutOfMemoryError,
        exceptions.WorkerCrashedError,
    )
    if isinstance(error, lost):
        return f"A task was lost {retries} times with its worker or machine; is there enough memory? {plain(error)}"
    if isinstance(error, exceptions.RayTaskError):
        cause = error.cause
        return f"A task failed on the cluster: {type(cause).__name__}: {plain(cause)}"
    return f"Ray could not run a task: {type(error).__name__}: {plain(error)}"


def checked(answer: Answer, seeds: Sequence[int]) -> Answer:
    """An answer that holds the episodes of these seeds.

    Raises:
        DrsError: it says why there are none, or holds others.
    """
    if answer.error is None:
        found = [episode.seed for episode in answer.episodes]
        if found != list(seeds):
            raise DrsError(f"A worker gave {len(found)} episodes, not those of the {len(seeds)} seeds asked for.")
        return answer
    if answer.exit_status is None:
        raise DrsError(f"A worker of the cluster failed; this is its report:\n{answer.error}")
    raise (UsageError if answer.exit_status == UsageError.exit_status else DrsError)(answer.error)
