"""Progress of a benchmark on standard error: a bar on a terminal, a line a part otherwise."""

from __future__ import annotations

import time

from rich.console import Console
from rich.markup import escape

from drs_core.reporting.progress import Bars


class BenchProgress(Bars):
    """Watches a benchmark; use it as a context manager."""

    def __init__(self, console: Console) -> None:
        """Messages and bars go to `console`."""
        super().__init__(console)
        self._console, self._started = console, time.monotonic()
        self._task = self._progress.add_task("", total=None)

    def on_part(self, name: str, turns: int) -> None:
        """A part begins."""
        if not self._console.is_terminal:
            self._console.print(f"{time.monotonic() - self._started:4.0f} s: {name}")
        self._progress.update(self._task, description=escape(name), total=turns, completed=0)

    def on_turn(self) -> None:
        """Move the bar."""
        self._progress.advance(self._task)

    def on_message(self, text: str) -> None:
        """Print a line."""
        self._console.print(text)
