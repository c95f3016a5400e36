"""Ctrl-C and SIGTERM end a training where its state is whole."""

from __future__ import annotations

import signal
import threading
from typing import Any


class Stopped(Exception):
    """The user has interrupted, and the state is whole."""


class Interrupts:
    """Within this context the first signal is noted, for `check`; a second one interrupts at once."""

    def __init__(self) -> None:
        """Nothing is noted yet."""
        self._noted = False
        self._before: dict[int, Any] = {}

    def check(self) -> None:
        """Raise Stopped where a signal was noted."""
        if self._noted:
            raise Stopped

    def __enter__(self) -> Interrupts:
        # Python lets only the main thread handle signals
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, *_: object) -> None:
        if self._noted:
            raise KeyboardInterrupt
        self._noted = True
