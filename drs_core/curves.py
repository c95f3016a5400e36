"""The curves of a run for TensorBoard, written as they come: without a thread, an error is found where it happens."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from drs_core.errors import DrsError, install


@contextmanager
def _without_torch() -> Iterator[None]:
    """Inside, torch is not found: tensorboardX would import it for a type's name, at 2.4 s and 150 MB a run."""
    if "torch" in sys.modules:
        yield
        return
    sys.modules["torch"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules["torch"]


def tensorboard_modules() -> tuple[Any, Any, Any]:
    """What writes event files, makes summaries, and the messages.

    Raises:
        DrsError: tensorboardX is not installed.
    """
    try:
        with _without_torch():
            from tensorboardX import event_file_writer, summary
            from tensorboardX.proto import event_pb2
    except ModuleNotFoundError as error:
        raise DrsError(f"Tuning needs tensorboardX; {install('sim')}.") from error
    return event_file_writer, summary, event_pb2


class Curves:
    """One event file, of one session of a run."""

    def __init__(self, folder: Path, done: int) -> None:
        """Begin; what an interrupted session wrote beyond `done` updates is hidden.

        Raises:
            DrsError: tensorboardX is not installed, or the folder cannot be written.
        """
        event_file_writer, summary, self._events = tensorboard_modules()
        self._folder, self._scalar = folder, summary.scalar
        self._writer: Any = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # the suffix keeps two sessions of one second from sharing a file
            self._writer = event_file_writer.EventsWriter(str(folder / "events"), f".{os.getpid()}.{done}")
            if done:
                start = self._events.SessionLog(status=self._events.SessionLog.START)
                self._write(step=done + 1, session_log=start)
        except OSError as error:
            raise self._failed(error) from error

    def add(self, group: str, record: Mapping[str, Any], update: int) -> None:
        """Add a record's numbers, and wait until they are on disk.

        Raises:
            DrsError: they cannot be written.
        """
        try:
            for key, value in record.items():
                if key != "update" and value is not None:
                    self._write(step=update, summary=self._scalar(f"{group}/{key}", value))
            self._writer.flush()
        except OSError as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """Close the file; every record is on disk already."""
        with suppress(OSError):
            self._writer.close()

    def _write(self, **content: Any) -> None:
        event = self._events.Event(**content)
        # the moment is for a person who compares sessions; nothing is decided by it
        event.wall_time = time.time()
        self._writer.write_event(event)

    def _failed(self, error: OSError) -> DrsError:
        if self._writer is not None:
            self.close()
        return DrsError(
            f"Cannot write {self._folder}: {error.strerror}; choose a folder with room that you may write. "
            "A run is kept up to its last update."
        )
