"""Standard streams that may be closed, full or unable to print a name."""

from __future__ import annotations

import io
import os
import sys
from typing import NoReturn


def prepare_streams() -> None:
    """Give closed descriptors somewhere to go, and let no file name be impossible to print."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name) or open(os.devnull, "w", encoding="utf-8")
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, stream)


def fail(message: str, status: int) -> NoReturn:
    """Say why on standard error and end with this status."""
    print(f"drs: {message}", file=sys.stderr)
    try:
        sys.stdout.flush()
    except OSError:
        # what is left in the buffer would fail once more when the interpreter ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    sys.exit(status)
