"""What a thread that answers an arm asks of the operating system: to go before others, and to keep its memory."""

from __future__ import annotations

import ctypes
import os

_ALL_NOW, _WHEN_USED = 1, 4
"""MCL_CURRENT and MCL_ONFAULT of Linux's mlockall. Not MCL_FUTURE: a limit would make later requests fail."""


def real_time(priority: int) -> str:
    """Let this thread go before all others of lower priority, as ros2_control's update thread does.

    The memory of the process stays where it is meanwhile: a page that the system has put away, or only marked to
    see whether it is used, is missed in the middle of an answer.

    Args:
        priority: 1 to 99, of SCHED_FIFO; 0: back among the threads without one.

    Returns:
        What to tell the user where the system does not allow it; empty where it does.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO if priority else os.SCHED_OTHER, os.sched_param(priority))
    except (OSError, AttributeError):
        return (
            f"Without real-time priority {priority}: the system does not allow it (ulimit -r). Answers may come "
            "late where other programs are busy; realtime_priority 0 does not ask."
        )
    if not _keep_memory(bool(priority)):
        return "Memory is not locked: the system does not allow it (ulimit -l). Answers may come late."
    return ""


def _keep_memory(keep: bool) -> bool:
    try:
        library = ctypes.CDLL(None)
        refused: int = library.mlockall(_ALL_NOW | _WHEN_USED) if keep else library.munlockall()
    except (OSError, AttributeError):
        # a system without it has nothing to undo
        return not keep
    return refused == 0
