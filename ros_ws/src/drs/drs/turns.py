"""A lock that is fair: whoever asks first is served first, so that an evaluation gets between two updates."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drs_core.errors import DrsError

_LOOK_S = 0.2


class Stopped(DrsError):
    """Someone asked to stop; what is done is kept."""


class Turns:
    """One at a time, in the order of asking."""

    def __init__(self) -> None:
        """Nobody waits."""
        self._waiting: deque[object] = deque()
        self._changed = threading.Condition()

    @contextmanager
    def turn(self, should_stop: Callable[[], bool]) -> Iterator[None]:
        """Wait for the turn, and hold it inside.

        Raises:
            Stopped: should_stop() became true while waiting.
        """
        mine = object()
        with self._changed:
            self._waiting.append(mine)
        try:
            with self._changed:
                while self._waiting[0] is not mine:
                    if should_stop():
                        raise Stopped("Stopped while waiting for its turn.")
                    self._changed.wait(_LOOK_S)
            yield
        finally:
            with self._changed:
                self._waiting.remove(mine)
                self._changed.notify_all()

    def busy(self) -> bool:
        """Whether somebody has the turn."""
        return bool(self._waiting)
