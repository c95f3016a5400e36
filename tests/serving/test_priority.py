"""Real-time priority is had, or its absence said."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest

from drs_core.serving import priority


def in_a_thread(calls):
    """What calls return in a thread of their own, whose priority ends with it."""
    told = []
    thread = threading.Thread(target=lambda: told.extend(call() for call in calls))
    thread.start()
    thread.join()
    return told


def policy_now() -> int:
    return os.sched_getscheduler(0)


def locked_kb() -> int:
    return int(Path("/proc/self/status").read_text().partition("VmLck:")[2].split()[0])


def test_a_thread_has_the_priority_or_the_user_a_sentence():
    said, policy, locked, again, after, free = in_a_thread(
        [lambda: priority.real_time(7), policy_now, locked_kb, lambda: priority.real_time(0), policy_now, locked_kb]
    )
    assert (policy == os.SCHED_FIFO) == ("priority" not in said)
    assert (policy == os.SCHED_FIFO and locked > 1000) == (said == "")
    assert again == "" and after == os.SCHED_OTHER and free == 0


@pytest.mark.parametrize("number", [errno.EPERM, errno.ENOSYS])
def test_where_the_system_refuses_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch, number: int):
    def refuse(*arguments):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert "priority 50" in priority.real_time(50) and "ulimit -r" in priority.real_time(50)


def test_where_memory_may_not_be_locked_it_says_so(monkeypatch: pytest.MonkeyPatch):
    class Refusing:
        def mlockall(self, flags: int) -> int:
            return -1

    monkeypatch.setattr(priority.ctypes, "CDLL", lambda name: Refusing())
    monkeypatch.setattr(os, "sched_setscheduler", lambda *arguments: None)
    assert "ulimit -l" in priority.real_time(50)
    # as on a system that does not know of it
    assert priority.real_time(0) == ""


@pytest.mark.parametrize("name", ["SCHED_FIFO", "sched_setscheduler"])
def test_where_there_is_no_such_scheduler_it_says_so_too(monkeypatch: pytest.MonkeyPatch, name: str):
    monkeypatch.delattr(os, name)
    assert "priority 50" in priority.real_time(50)
