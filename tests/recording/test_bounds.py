"""Small files that unpack to much: refused with a sentence, soon and with little memory."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import pytest
import zstandard

from drs_core.errors import UsageError
from drs_core.recording import reader, steps
from drs_core.recording.definitions import ACTION, ACTION_TYPE, OBSERVATION, OBSERVATION_TYPE
from drs_core.recording.observed import of_recording
from drs_core.recording.reader import RecordingReader
from drs_core.recording.replay import replay
from drs_core.recording.writer import RecordingWriter
from tests.conftest import drs, make_agent, refused
from tests.recording.conftest import action_bytes, actions_of, observation_bytes

MAGIC = b"\x89MCAP0\r\n"


def record(code: int, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


def text(content: str) -> bytes:
    return struct.pack("<I", len(content)) + content.encode()


def schema(number: int, kind: str, definition: str) -> bytes:
    return record(3, struct.pack("<H", number) + text(kind) + text("ros2msg") + text(definition))


def channel(number: int, of_schema: int, topic: str) -> bytes:
    return record(4, struct.pack("<HH", number, of_schema) + text(topic) + text("cdr") + text(""))


def message(of_channel: int, data: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", of_channel, 0, 0, 0) + data)


def chunk(content: bytes) -> bytes:
    packed = zstandard.compress(content)
    head = struct.pack("<QQQI", 0, 0, len(content), 0) + text("zstd")
    return record(6, head + struct.pack("<Q", len(packed)) + packed)


KNOWN = (
    schema(1, OBSERVATION_TYPE, OBSERVATION)
    + schema(2, ACTION_TYPE, ACTION)
    + channel(1, 1, "/observation")
    + channel(2, 2, "/action")
)


def write(path: Path, *records: bytes) -> Path:
    path.write_bytes(MAGIC + record(1, text("ros2") + text("")) + KNOWN + b"".join(records))
    return path


def test_an_observation_that_no_agent_could_have_had_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    # none of them had an action, so that each was kept whole: a file of 130 kB took 4 GB
    path = write(tmp_path / "x.mcap", chunk(message(1, bytes(10**7))))
    assert path.stat().st_size < 5000
    for read in (replay, of_recording):
        with pytest.raises(UsageError, match=r"message of 10000000 bytes on '/observation'; .*have 16 and at most"):
            read(path, make_agent())
    make_agent().save(tmp_path / "agent.safetensors")
    done = drs("replay", path, tmp_path / "agent.safetensors", "--json")
    refused(done, "a message of 10000000 bytes")
    assert done.returncode == 2
    with pytest.raises(UsageError, match=r"message of 10000000 bytes on '/action'; .*have 4 and at most"):
        replay(write(path, chunk(message(2, bytes(10**7)))), make_agent())


def test_parts_are_compared_before_an_observation_waits(tmp_path: Path) -> None:
    agent, path = make_agent(), tmp_path / "x.mcap"
    for keys in (["observation"], ["elsewhere"], ["observation", "observation"]):
        sizes = [3] if keys == ["observation"] else [2] * len(keys)
        data = observation_bytes(agent, 1, keys=keys, sizes=sizes, values=[0.0] * sum(sizes))
        with pytest.raises(UsageError, match="has observations of"):
            replay(write(path, message(1, data)), agent)


def test_few_large_observations_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    agent = make_agent()
    seen = [message(1, observation_bytes(agent, number)) for number in (1, 2, 3, 4, 5)]
    did = [message(2, action_bytes(number, action)) for number, action in enumerate(actions_of(agent, 5), start=1)]
    path = write(tmp_path / "x.mcap", *seen, *did)
    assert (len(replay(path, agent).recorded), replay(path, agent).unanswered) == (5, 0)
    monkeypatch.setattr(steps, "MAX_WAITING_NUMBERS", 6)
    assert (len(replay(path, agent).recorded), replay(path, agent).unanswered) == (3, 2)


def test_a_file_that_unpacks_to_much_more_than_its_size_is_refused(tmp_path: Path) -> None:
    others = schema(3, "std_msgs/msg/String", "string data") + channel(3, 3, "/text")
    path = write(tmp_path / "x.mcap", others, *[chunk(message(3, bytes(10**7)))] * 20)
    with pytest.raises(UsageError, match="unpacks to more than 1000 times its size"):
        list(RecordingReader(path).messages())


def test_definitions_are_bounded_and_given_once(tmp_path: Path) -> None:
    large = [chunk(schema(10 + i, "a/msg/A", " " * 6 * 10**6)) for i in range(3)]
    with pytest.raises(UsageError, match="definitions of more than 16777216 bytes"):
        list(RecordingReader(write(tmp_path / "x.mcap", *large)).messages())
    assert not list(RecordingReader(write(tmp_path / "x.mcap", *large[:2], *large[:2], KNOWN)).messages())
    for again in (channel(1, 1, "/elsewhere"), channel(1, 2, "/observation"), schema(1, "a/msg/A", "")):
        with pytest.raises(UsageError, match="one number to two topics"):
            list(RecordingReader(write(tmp_path / "x.mcap", again)).messages())


def test_messages_of_a_chunk_are_not_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # each of 31 bytes took two hundred
    content = message(2, b"") * 100_000
    monkeypatch.setattr(reader, "MAX_RECORD_BYTES", len(content))
    path = write(tmp_path / "x.mcap", chunk(content))
    tracemalloc.start()
    try:
        assert sum(1 for _ in RecordingReader(path).messages()) == 100_000
        assert tracemalloc.get_traced_memory()[1] < 2.5 * len(content)
    finally:
        tracemalloc.stop()


def test_a_recording_of_a_graph_is_far_from_the_bound(tmp_path: Path) -> None:
    agent, path = make_agent(), tmp_path / "still.mcap"
    with RecordingWriter(path) as writer:
        writer.add_topic("/observation", OBSERVATION_TYPE, OBSERVATION)
        # nothing moves, and the clock stands
        data = observation_bytes(agent, 1)
        for number in range(50_000):
            writer.write("/observation", data, number, number)
    assert 50_000 * len(data) < reader.MAX_RATIO * path.stat().st_size / 10
