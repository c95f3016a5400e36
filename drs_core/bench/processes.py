"""CPU time, memory and state of other processes."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Sequence

import psutil


def cpu_seconds(pid: int) -> float:
    """CPU time that a process has used, all its threads together [s].

    The process's CPU clock (clock_getcpuclockid, POSIX) counts nanoseconds; /proc counts hundredths of a second.
    """
    clock = ctypes.c_int()
    if ctypes.CDLL(None).clock_getcpuclockid(pid, ctypes.byref(clock)) != 0:
        raise ProcessLookupError(f"process {pid} has ended")
    return time.clock_gettime(clock.value)


def together(pids: Sequence[int]) -> float:
    """CPU time of this process and of `pids` [s]."""
    return time.process_time() + sum(map(cpu_seconds, pids))


def resident_mb(pid: int) -> float:
    """Memory that a process holds, shared libraries included [MB]."""
    return float(psutil.Process(pid).memory_info().rss) / 1e6


def processes(pids: Sequence[int]) -> list[psutil.Process]:
    """Handles of processes, for `all_running`."""
    return [psutil.Process(pid) for pid in pids]


def all_running(watched: Sequence[psutil.Process]) -> bool:
    """Whether every process computes or waits for a core, and none waits for work."""
    return all(process.status() == psutil.STATUS_RUNNING for process in watched)
