"""Holds a run between two updates until a person lets it go on, and keeps everything else still meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drs.turns import Stopped
from drs_core.errors import UsageError

_LOOK_S = 0.1


class Pause:
    """Asked for by services, kept by the thread of a run, and looked at by evaluations."""

    def __init__(self, others: Callable[[], bool] = lambda: False) -> None:
        """Nothing is paused; `others` says whether anything moves that is not in `moving`."""
        self._changed, self._others = threading.Condition(), others
        self._asked, self._moving = False, 0

    @property
    def asked(self) -> bool:
        """Whether nothing more may begin to move."""
        return self._asked

    def ask(self) -> None:
        """Let nothing begin from now on; what moves already is not stopped."""
        with self._changed:
            self._asked = True

    def end(self) -> bool:
        """Let everything go on; whether anything was paused."""
        with self._changed:
            was, self._asked = self._asked, False
            self._changed.notify_all()
            return was

    @contextmanager
    def moving(self) -> Iterator[None]:
        """Something beside the run moves inside.

        Raises:
            UsageError: nothing may begin now.
        """
        with self._changed:
            if self._asked:
                raise UsageError("The tuner is paused, and nothing moves until ~/resume is called; ask again after it.")
            self._moving += 1
        try:
            yield
        finally:
            with self._changed:
                self._moving -= 1
                self._changed.notify_all()

    def keep(self, should_stop: Callable[[], bool], still: Callable[[], None]) -> None:
        """Hold the calling thread for as long as a pause lasts; `still` is called once nothing moves any more.

        Raises:
            Stopped: should_stop() became true.
        """
        self._until(lambda: not (self._asked and (self._moving or self._others())), should_stop)
        if self._asked:
            still()
            self._until(lambda: not self._asked, should_stop)

    def _until(self, condition: Callable[[], bool], should_stop: Callable[[], bool]) -> None:
        with self._changed:
            while not condition():
                if should_stop():
                    raise Stopped("Stopped while paused; what is done is kept.")
                self._changed.wait(_LOOK_S)
