"""The topics of a recording, as its records define them: each once, and in all no more than fits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from drs_core.errors import UsageError

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

MAX_DEFINITIONS_BYTES = 16 * 2**20
"""Names and definitions of a file together; those of a large graph are less than one megabyte."""


@dataclass(frozen=True)
class Topic:
    """A topic of a recording.

    Attributes:
        name: its whole name.
        kind: type, such as ``sensor_msgs/msg/JointState``.
        definition: of the type, as the file has it.
    """

    name: str
    kind: str
    definition: str


class Topics:
    """What the messages of one file are of.

    Attributes:
        found: in the order of the file.
    """

    def __init__(self, path: Path) -> None:
        """Name the file, for messages."""
        self.found: list[Topic] = []
        self._path, self._bytes = path, 0
        self._schemas: dict[int, Schema] = {}
        self._texts: dict[int, str] = {}
        self._channels: dict[int, tuple[str, int]] = {}
        self._topics: dict[int, Topic] = {}

    def define(self, schema: Schema) -> None:
        """Take a definition.

        Raises:
            UsageError: it is another one than before, or too much.
        """
        if self._is_new(schema, self._schemas.get(schema.id), len(schema.name) + len(schema.data)):
            self._schemas[schema.id] = schema

    def add(self, channel: Channel) -> None:
        """Take a topic whose definition came before.

        Raises:
            UsageError: it is another one than before, or too much.
        """
        this = channel.topic, channel.schema_id
        if self._is_new(this, self._channels.get(channel.id), len(channel.topic)):
            schema = self._schemas[channel.schema_id]
            # one text, however many topics are of its type
            if schema.id not in self._texts:
                self._texts[schema.id] = schema.data.decode()
            self._channels[channel.id] = this
            self._topics[channel.id] = Topic(channel.topic, schema.name, self._texts[schema.id])
            self.found.append(self._topics[channel.id])

    def __getitem__(self, channel: int) -> Topic:
        """The topic of a message."""
        return self._topics[channel]

    def _is_new(self, this: object, before: object, size: int) -> bool:
        if before is not None:
            if this != before:
                raise UsageError(f"{self._path} is damaged: it gives one number to two topics or two definitions.")
            return False
        self._bytes += size
        if self._bytes > MAX_DEFINITIONS_BYTES:
            raise UsageError(
                f"{self._path} has definitions of more than {MAX_DEFINITIONS_BYTES} bytes, the most that is read."
            )
        return True
