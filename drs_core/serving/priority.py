"""The scheduler's class of the thread that answers an arm."""

from __future__ import annotations

import os


def real_time(priority: int) -> str:
    """Let this thread go before all others of lower priority, as ros2_control's update thread does.

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
    return ""
