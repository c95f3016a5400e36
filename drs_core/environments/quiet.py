"""Keep C libraries off the terminal: PyBullet prints a line for its import and one for every client."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def redirected(descriptor: int, target: int | None = None) -> Iterator[int]:
    """Send file descriptor 1 or 2 to `target` (default: nowhere); yields a descriptor of the real one."""
    _flush()
    real = os.dup(descriptor)
    sink = os.open(os.devnull, os.O_WRONLY) if target is None else os.dup(target)
    os.dup2(sink, descriptor)
    os.close(sink)
    try:
        yield real
    finally:
        _flush()
        os.dup2(real, descriptor)
        os.close(real)


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing reaches standard output or standard error inside; errors still raise."""
    with redirected(1), redirected(2):
        yield


def _flush() -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    # what C code printed may still lie in the C library's buffer
    ctypes.CDLL(None).fflush(None)
