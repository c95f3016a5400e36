"""The errors that a user can mend; everything else is a bug and keeps its traceback."""

from __future__ import annotations


class DrsError(Exception):
    """Something failed; the message is one or two sentences with the value and the mend."""

    exit_status = 1


class UsageError(DrsError):
    """What was asked for cannot be done as asked: a wrong name, value or file."""

    exit_status = 2
