"""The errors that a user can mend; everything else is a bug and keeps its traceback."""

from __future__ import annotations

import reprlib
from typing import Any


class DrsError(Exception):
    """Something failed; the message is one or two sentences with the value and the mend."""

    exit_status = 1


class UsageError(DrsError):
    """What was asked for cannot be done as asked: a wrong name, value or file."""

    exit_status = 2


def shown(value: Any) -> str:
    """A value from a file, short enough for a message whatever it holds."""
    if isinstance(value, str):
        return repr(value[:80])
    try:
        return reprlib.repr(value)[:80]
    except ValueError:  # an integer of thousands of digits
        return f"a huge {type(value).__name__}"
