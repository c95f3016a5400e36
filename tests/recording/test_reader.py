"""Recordings that anybody may have made: read within bounds, or refused with a sentence."""

from __future__ import annotations

import time
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from drs_core.errors import UsageError
from drs_core.recording import reader
from drs_core.recording.definitions import ACTION, ACTION_TYPE, OBSERVATION, OBSERVATION_TYPE, normalised
from drs_core.recording.reader import RecordingReader, contents
from drs_core.recording.replay import replay
from drs_core.recording.writer import RecordingWriter
from tests.conftest import make_agent
from tests.recording.conftest import action_bytes, actions_of, observation_bytes, write

ROOT = Path(__file__).parents[2]


def test_contents_are_counted(recording: Path) -> None:
    found = contents(recording)
    assert {topic.name: count for topic, count in found.counts.items()} == {"/observation": 60, "/action": 60}
    assert found.duration_s == pytest.approx(59 * 0.04) and found.complete


def test_what_is_written_can_be_read_before_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drs_core.recording.writer.FLUSH_S", 0.0)
    agent, path = make_agent(), tmp_path / "open.mcap"
    writer = RecordingWriter(path)
    writer.add_topic("/observation", OBSERVATION_TYPE, OBSERVATION)
    for number in range(1, 11):
        writer.write("/observation", observation_bytes(agent, number), number, number)
        found = contents(path)
        assert sum(found.counts.values()) == number and not found.complete
    writer.close()
    assert contents(path).complete


def test_what_came_last_is_on_the_disk_too(tmp_path: Path) -> None:
    path = tmp_path / "open.mcap"
    writer = RecordingWriter(path)
    writer.add_topic("/observation", OBSERVATION_TYPE, OBSERVATION)
    writer.write("/observation", observation_bytes(make_agent(), 1), 1, 1)
    # and then nothing comes
    end_s = time.monotonic() + 10.0
    while not sum(contents(path).counts.values()):
        writer.flush()
        assert time.monotonic() < end_s
        time.sleep(0.05)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damage_gives_a_sentence_or_a_result(recording: Path, data: st.DataObject) -> None:
    content = bytearray(recording.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    damaged = recording.with_name("damaged.mcap")
    damaged.write_bytes(bytes(content[: data.draw(st.integers(0, len(content)))]))
    try:
        replay(damaged, make_agent())
    except UsageError as error:
        assert len(str(error)) < 1000


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(payload=st.binary(max_size=400), kind=st.sampled_from(["o", "a"]))
def test_messages_of_any_bytes_are_refused_or_read(tmp_path: Path, payload: bytes, kind: str) -> None:
    path = tmp_path / "wild.mcap"
    with RecordingWriter(path) as writer:
        writer.add_topic("/observation", OBSERVATION_TYPE, OBSERVATION)
        writer.add_topic("/action", ACTION_TYPE, ACTION)
        good = observation_bytes(make_agent(), 1), action_bytes(1, actions_of(make_agent(), 1)[0])
        writer.write("/observation", b"\x00\x01\x00\x00" + payload if kind == "o" else good[0], 1, 1)
        writer.write("/action", b"\x00\x01\x00\x00" + payload if kind == "a" else good[1], 1, 1)
    with pytest.raises(UsageError):
        replay(path, make_agent())


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_that_unpacks_to_more_than_allowed_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: CompressionType
) -> None:
    monkeypatch.setattr(reader, "MAX_RECORD_BYTES", 100_000)
    path = tmp_path / "bomb.mcap"
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=10**7, compression=compression)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        writer.add_message(channel, 0, bytes(10**6), 0)
        writer.finish()
    assert path.stat().st_size < 20_000
    with pytest.raises(UsageError, match="more than 100000 bytes"):
        list(RecordingReader(path).messages())


def test_frames_that_do_not_tell_their_size_are_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MAX_RECORD_BYTES", 1000)
    silent = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(10**6))
    assert len(reader._unzstd(silent)) == 1001
    assert len(reader._unlz4(lz4.frame.compress(bytes(10**6), store_size=False))) == 1001


def test_a_definition_of_its_own_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.mcap"
    with RecordingWriter(path) as writer:
        # four thousand million messages of no bytes each
        own = "Nothing[4000000000] values\n" + "=" * 80 + "\nMSG: drs_interfaces/Nothing\n"
        writer.add_topic("/observation", OBSERVATION_TYPE, own)
        writer.add_topic("/action", ACTION_TYPE, ACTION)
        writer.write("/observation", bytes(8), 1, 1)
        writer.write("/action", bytes(8), 1, 1)
    with pytest.raises(UsageError, match="defines drs_interfaces/msg/Observation in another way"):
        replay(path, make_agent())


@pytest.mark.parametrize(("name", "known"), [("Observation", OBSERVATION), ("Action", ACTION)])
def test_what_is_known_is_what_the_workspace_defines(name: str, known: str) -> None:
    text = (ROOT / "ros_ws" / "src" / "drs_interfaces" / "msg" / f"{name}.msg").read_text()
    assert normalised(known).split("\n====")[0] == normalised(text)


def test_several_topics_are_for_the_user_to_choose_from(tmp_path: Path) -> None:
    agent, path = make_agent(), tmp_path / "two.mcap"
    actions = actions_of(agent, 2)
    with RecordingWriter(path) as writer:
        for prefix in ("/a", "/b"):
            writer.add_topic(f"{prefix}/observation", OBSERVATION_TYPE, OBSERVATION)
            writer.add_topic(f"{prefix}/action", ACTION_TYPE, ACTION)
            for number in (1, 2):
                writer.write(f"{prefix}/observation", observation_bytes(agent, number), number, number)
                writer.write(f"{prefix}/action", action_bytes(number, actions[number - 1]), number, number)
    with pytest.raises(UsageError, match="/a/observation, /b/observation; name one with --topic"):
        replay(path, agent)
    assert len(replay(path, agent, "/b/observation").recorded) == 2


def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    from drs_core.errors import DrsError

    agent = make_agent()
    with pytest.raises(DrsError, match="Cannot write"):
        write(Path("/dev/full"), agent, actions_of(agent, 3))
    with pytest.raises(DrsError, match="Cannot write"):
        RecordingWriter(tmp_path / "absent" / "x.mcap")
