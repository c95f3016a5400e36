"""Real-time priority is had, or its absence said."""

from __future__ import annotations

import errno
import os
import threading

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


def test_a_thread_has_the_priority_or_the_user_a_sentence():
    said, policy, again, after = in_a_thread(
        [lambda: priority.real_time(7), policy_now, lambda: priority.real_time(0), policy_now]
    )
    assert (policy == os.SCHED_FIFO) == (said == "")
    assert again == "" and after == os.SCHED_OTHER


@pytest.mark.parametrize("number", [errno.EPERM, errno.ENOSYS])
def test_where_the_system_refuses_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch, number: int):
    def refuse(*arguments):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert "priority 50" in priority.real_time(50) and "ulimit -r" in priority.real_time(50)


@pytest.mark.parametrize("name", ["SCHED_FIFO", "sched_setscheduler"])
def test_where_there_is_no_such_scheduler_it_says_so_too(monkeypatch: pytest.MonkeyPatch, name: str):
    monkeypatch.delattr(os, name)
    assert "priority 50" in priority.real_time(50)
