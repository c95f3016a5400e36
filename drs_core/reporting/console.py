"""What a command prints where: results, messages, one JSON object."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.table import Table

from drs_core.environments import redirected


@contextmanager
def printer(as_json: bool) -> Iterator[Printer]:
    """With --json, nothing but the result reaches standard output, whatever a library prints."""
    if not as_json:
        yield Printer(None)
        return
    with redirected(1, target=2) as real:
        yield Printer(real)


class Printer:
    """Where a result goes: JSON to a descriptor, or lines and tables to standard output."""

    def __init__(self, json_descriptor: int | None) -> None:
        self._json = json_descriptor

    def show(self, result: dict[str, Any], *lines: Table | str) -> None:
        """Print `result` as JSON, or `lines` for people."""
        if self._json is not None:
            os.write(self._json, (json.dumps(result, allow_nan=False) + "\n").encode())
            return
        # no markup: a path may look like it
        console = Console(width=None if sys.stdout.isatty() else 120, highlight=False, markup=False, emoji=False)
        for line in lines:
            console.print(line, soft_wrap=isinstance(line, str))


def messages() -> Console:
    """A console for progress and messages, plain where it is no terminal."""
    width = None if sys.stderr.isatty() else 160
    return Console(stderr=True, width=width, highlight=False, markup=False, emoji=False)
