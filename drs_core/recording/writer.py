"""Write messages, serialised as they came, to an MCAP file that other programs open."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from drs_core import __version__
from drs_core.errors import DrsError, install

FLUSH_S = 1.0
"""A recorder that is killed loses what came in about this time."""


class RecordingWriter:
    """One file. What is written is on disk within about a second, and readable also without the end."""

    def __init__(self, path: Path) -> None:
        """Begin the file.

        Raises:
            DrsError: it cannot be written, or the library for it is not installed.
        """
        try:
            from mcap.writer import Writer
        except ModuleNotFoundError as error:
            raise DrsError(f"A recording needs mcap; {install('record')}.") from error
        self.path, self.messages, self._flushed = path, 0, 0
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_s, self._broken = time.monotonic(), False
        try:
            self._file = open(path, "wb")
        except OSError as error:
            raise self._failed(error) from error
        self._writer = Writer(self._file)
        self._writer.start(profile="ros2", library=f"drs {__version__}")

    def add_topic(self, topic: str, kind: str, definition: str, qos: str = "") -> None:
        """Take messages of a topic from now on.

        Args:
            topic: its whole name.
            kind: type, such as ``sensor_msgs/msg/JointState``.
            definition: of the type and all that it is made of.
            qos: what its publishers offer, in rosbag2's YAML.
        """
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition.encode())
        self._channels[topic] = self._writer.register_channel(
            topic, "cdr", self._schemas[kind], {"offered_qos_profiles": qos}
        )

    def write(self, topic: str, data: bytes, received_ns: int, published_ns: int) -> None:
        """Keep a message of a topic, serialised, with its moments since 1970.

        Raises:
            DrsError: it cannot be written.
        """
        self._try(self._writer.add_message, self._channels[topic], received_ns, data, published_ns)
        self.messages += 1
        self.flush()

    def flush(self) -> None:
        """Bring what came in to the disk, once a second; for whoever writes on topics that may fall silent.

        Raises:
            DrsError: it cannot be written.
        """
        if self.messages > self._flushed and time.monotonic() - self._flushed_s >= FLUSH_S:
            self._try(self._writer.flush)
            self._flushed, self._flushed_s = self.messages, time.monotonic()

    def close(self) -> None:
        """Write the end, with the index; again does nothing.

        Raises:
            DrsError: it cannot be written, for the first time; what was written before can be read.
        """
        if self._file.closed:
            return
        try:
            if not self._broken:
                self._try(self._writer.finish)
                self._try(self._file.flush)
        finally:
            # what is still in its buffer could not be written
            with suppress(OSError):
                self._file.close()

    def __enter__(self) -> RecordingWriter:
        """The writer itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Write the end, also of what was interrupted."""
        self.close()

    def _try(self, call: Any, *arguments: Any) -> None:
        try:
            call(*arguments)
        except OSError as error:
            self._broken = True
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> DrsError:
        return DrsError(f"Cannot write {self.path}: {error.strerror}; name another file or make room.")
