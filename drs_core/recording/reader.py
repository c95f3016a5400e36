"""Read an MCAP file that anybody may have made: bounded, to its end or to where it breaks off."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from drs_core.errors import DrsError, UsageError, install
from drs_core.recording.topics import Topic, Topics

MAX_RECORD_BYTES = 64 * 2**20
"""A chunk of rosbag2 has less than one megabyte; camera images may have more."""

MAX_RATIO = 1000
"""What a file may unpack to beyond one such record, by its size; joint states come to less than fifty."""


@dataclass(frozen=True)
class Recorded:
    """A message as it was serialised, and when it came [ns since 1970]."""

    topic: Topic
    received_ns: int
    data: bytes


class RecordingReader:
    """The messages of one file in the order in which they were written.

    Attributes:
        complete: whether the file has its end; known after the last message.
        topics: with or without messages; likewise.
    """

    def __init__(self, path: Path) -> None:
        """Name the file; nothing is read yet."""
        self.path, self.complete = path, False
        self.topics: list[Topic] = []

    def messages(self) -> Iterator[Recorded]:
        """Every message that can be read.

        Raises:
            UsageError: it is not a recording, or damaged.
            DrsError: the library for it is not installed.
        """
        if not self.path.is_file():
            raise UsageError(f"{self.path} is not a file; check the path.")
        try:
            yield from self._messages()
        except DrsError:
            raise
        except Exception as error:
            # the library raises many kinds of errors for bytes that make no sense
            raise UsageError(f"{self.path} is not an MCAP recording, or damaged: {str(error)[:200]}.") from error

    def _messages(self) -> Iterator[Recorded]:
        from mcap.records import Channel, Message, Schema

        topics = Topics(self.path)
        self.topics = topics.found
        for record in self._records():
            if isinstance(record, Schema):
                topics.define(record)
            elif isinstance(record, Channel):
                topics.add(record)
            elif isinstance(record, Message):
                yield Recorded(topics[record.channel_id], record.log_time, record.data)

    def _records(self) -> Iterator[Any]:
        """Records, chunks taken apart, up to the footer or to where the file breaks off."""
        try:
            from mcap.exceptions import EndOfFile
            from mcap.records import Chunk, Footer
            from mcap.stream_reader import StreamReader
        except ModuleNotFoundError as error:
            raise DrsError(f"A recording needs mcap; {install('record')}.") from error
        with open(self.path, "rb") as file:
            most = MAX_RECORD_BYTES + MAX_RATIO * self.path.stat().st_size
            try:
                for record in StreamReader(file, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES).records:
                    if isinstance(record, Footer):
                        self.complete = True
                        return
                    if isinstance(record, Chunk):
                        chunk = self._unpacked(record)
                        most -= len(chunk.data)
                        if most < 0:
                            raise UsageError(
                                f"{self.path} unpacks to more than {MAX_RATIO} times its size, the most that is read."
                            )
                        yield from _records_of(chunk)
                    else:
                        yield record
            except (EndOfFile, struct.error):
                if file.read(1):
                    raise
                # the file ends within a record: whoever wrote it was killed, and what is there is good

    def _unpacked(self, chunk: Any) -> Any:
        """The chunk without compression; a small file may unpack to a huge one, so no more than the bound is."""
        data = _UNPACK[chunk.compression](chunk.data)
        if len(data) > MAX_RECORD_BYTES:
            raise UsageError(f"{self.path} has a chunk of more than {MAX_RECORD_BYTES} bytes, the most that is read.")
        return replace(chunk, compression="", data=data)


def _records_of(chunk: Any) -> Iterator[Any]:
    """Those of a chunk that was unpacked, one by one: the library lists them, and two million fit into one chunk."""
    from mcap.opcode import Opcode
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import get_chunk_data_stream

    stream, end = get_chunk_data_stream(chunk, validate_crc=True)
    while stream.count < end:
        opcode, length = stream.read1(), stream.read8()
        if opcode == Opcode.MESSAGE:
            yield Message.read(stream, length)
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(stream)
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(stream)
        else:
            stream.read(length)


def _unzstd(data: bytes) -> bytes:
    import zstandard

    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        return bytes(stream.read(MAX_RECORD_BYTES + 1))


def _unlz4(data: bytes) -> bytes:
    import lz4.frame

    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=MAX_RECORD_BYTES + 1))


_UNPACK: dict[str, Callable[[bytes], bytes]] = {"": bytes, "zstd": _unzstd, "lz4": _unlz4}


@dataclass(frozen=True)
class Contents:
    """What a recording holds.

    Attributes:
        counts: messages of each topic.
        duration_s: from the first message to the last.
        complete: whether the file has its end.
    """

    counts: dict[Topic, int]
    duration_s: float
    complete: bool


def contents(path: Path) -> Contents:
    """Look through a recording.

    Raises:
        UsageError: it is not a recording, or damaged.
    """
    reader, counts = RecordingReader(path), dict[Topic, int]()
    first = last = None
    for message in reader.messages():
        counts[message.topic] = counts.get(message.topic, 0) + 1
        first = message.received_ns if first is None else first
        last = message.received_ns
    duration_s = 0.0 if first is None or last is None else 1e-9 * (last - first)
    return Contents(dict.fromkeys(reader.topics, 0) | counts, duration_s, reader.complete)
