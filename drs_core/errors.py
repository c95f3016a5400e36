"""The errors that a user can mend; everything else is a bug and keeps its traceback."""

from __future__ import annotations

import reprlib
from typing import Any

LONGEST_MESSAGE = 1000


class DrsError(Exception):
    """Something failed; the message is one or two sentences with the value and the mend."""

    exit_status = 1
    longest = LONGEST_MESSAGE

    def __str__(self) -> str:
        """The message, fit for a terminal, a log and a ROS message, whatever file a part of it comes from."""
        return presentable(super().__str__(), self.longest)


class UsageError(DrsError):
    """What was asked for cannot be done as asked: a wrong name, value or file."""

    exit_status = 2


def presentable(text: str, longest: int = LONGEST_MESSAGE) -> str:
    """A text without characters that a terminal takes for commands or that no encoding has, and not too long."""
    half = longest // 2
    short = text if len(text) <= longest else f"{text[:half]} \N{HORIZONTAL ELLIPSIS} {text[3 - half :]}"
    if short.replace("\n", " ").isprintable():
        return short
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in short)


def shown(value: Any) -> str:
    """A value from a file, short enough for a message whatever it holds."""
    if isinstance(value, str):
        return repr(value[:80])
    try:
        return reprlib.repr(value)[:80]
    except ValueError:  # an integer of thousands of digits
        return f"a huge {type(value).__name__}"


def install(extra: str) -> str:
    """How a package that is missing comes here: by an optional dependency of drs, in the versions tested together."""
    return f"install it in the folder of drs: pip install -c constraints.txt -e '.[{extra}]'"
