"""Inputs that a campaign found to be met wrongly, each with what it did."""

from __future__ import annotations

import os
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from drs_core import json_lines
from drs_core.errors import LONGEST_MESSAGE, DrsError, UsageError
from drs_core.files import parse_json, read_bounded, write_atomically
from drs_core.importing import import_agent
from drs_core.plain_yaml import read_plain_yaml
from drs_core.run_folder import RunFolder
from tests.conftest import drs, make_agent, refused
from tests.fuzz import seeds
from tests.fuzz.mutate import zipped


def test_a_small_file_takes_little_memory_however_large_it_might_be(tmp_path: Path) -> None:
    path = tmp_path / "small"
    path.write_bytes(b"x" * 3_000_000)
    tracemalloc.start()
    try:
        assert read_bounded(path, 2**30) == b"x" * 3_000_000
        # read(2**30 + 1) took 2**30 + 1 bytes
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
    for most_bytes in (0, 2**20 - 1, 2_999_999):
        with pytest.raises(UsageError, match=f"larger than {most_bytes} bytes"):
            read_bounded(path, most_bytes)
    assert len(read_bounded(path, 3_000_000)) == 3_000_000


def test_a_storage_of_half_a_number(tmp_path: Path) -> None:
    folder = seeds.zoo(tmp_path / "zoo")
    whole = (folder / f"{seeds.ENVIRONMENT}.zip").read_bytes()
    parts = dict(_members(whole))
    inner = {
        name: content[:-1] if name.endswith("data/4") else content for name, content in _members(parts["policy.pth"])
    }
    parts["policy.pth"] = zipped(list(inner.items()))
    (folder / f"{seeds.ENVIRONMENT}.zip").write_bytes(zipped(list(parts.items())))
    with pytest.raises(UsageError, match="no whole numbers"):
        import_agent(str(folder))


def _members(content: bytes) -> list[tuple[str, bytes]]:
    import io
    import zipfile

    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


@pytest.mark.parametrize("text", ["a: 1\nb: {c: 1, d: 2, c: 3}\n", "c: 1\nc: 1\n", "!!python/dict {c: 1, c: 2}\n"])
def test_yaml_that_gives_a_key_twice(tmp_path: Path, text: str) -> None:
    # the last one was taken without a word
    path = tmp_path / "twice.yaml"
    path.write_text(text)
    with pytest.raises(UsageError, match="gives 'c' twice; keep one"):
        read_plain_yaml(path)


@pytest.mark.parametrize("opened", ["[", "{", "{a: ", "? ", "- ", "!!python/tuple ["])
def test_yaml_that_opens_again_and_again(tmp_path: Path, opened: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(opened * (60_000 // len(opened)))
    begun_s = time.process_time()
    with pytest.raises(UsageError, match=r"50 are read|not a readable"):
        read_plain_yaml(path)
    # three thousand took more than two seconds, and the time grew with the square
    assert time.process_time() - begun_s < 2.0


def test_names_that_a_terminal_would_obey(tmp_path: Path) -> None:
    agent, path = make_agent(), tmp_path / "x.safetensors"
    content = agent.to_bytes()
    path.write_bytes(content.replace(b'"F32"', b'"\\u001b[2J\\u202e"'.ljust(5), 1))
    size = int.from_bytes(content[:8], "little") + len(path.read_bytes()) - len(content)
    path.write_bytes(size.to_bytes(8, "little") + path.read_bytes()[8:])
    result = drs("evaluate", path)
    refused(result, "x1b[2J")
    assert "\x1b" not in result.stderr and "\u202e" not in result.stderr


@pytest.mark.parametrize("text", ["x" * 5000, "\x1b[2J" * 900, "\ud800", "a\x00b"])
def test_a_message_is_short_and_can_be_shown_and_sent(text: str) -> None:
    shown = str(UsageError(f"{text} is wrong; give another."))
    assert shown.isprintable() and shown.encode() and shown.endswith("is wrong; give another.")
    assert len(shown) < 6 * LONGEST_MESSAGE
    ordinary = "A sentence of two lines,\nwith \N{HORIZONTAL ELLIPSIS} and \N{GREEK SMALL LETTER ALPHA}."
    assert str(DrsError(ordinary)) == ordinary


@pytest.mark.parametrize("kind", [str, str.encode])
def test_json_with_half_a_character_is_refused(kind: Callable[[str], str | bytes]) -> None:
    for text in ('{"name": "\\ud800"}', '{"\\uDFFF": 1}'):
        with pytest.raises(UsageError, match="x is not valid JSON"):
            parse_json(kind(text), "x")
    assert parse_json(kind('["\\ud83d\\ude00", "\\\\ud800"]'), "x") == ["\N{GRINNING FACE}", "\\ud800"]


@pytest.mark.parametrize("number", ["1e999", "-1e999", "1" + "0" * 400 + ".0"])
def test_a_number_that_would_be_written_as_infinity_is_refused(number: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"x is not valid JSON: .* is too large"):
        parse_json(f'[{{"deep": {number}}}]', "x")
    lines = tmp_path / "history.jsonl"
    lines.write_text(f'{{"update": 1, "objective_mean": {number}}}\n{{"update": 2}}\n')
    before = lines.read_bytes()
    with pytest.raises(UsageError, match="is too large"):
        json_lines.cut_back(lines, 1)
    assert lines.read_bytes() == before


@pytest.mark.parametrize("name", [".lock", "history.jsonl", "evaluations.jsonl", "tensorboard"])
def test_a_link_in_a_run_folder_leads_nowhere(tmp_path: Path, name: str) -> None:
    folder, precious = RunFolder(tmp_path / "run"), tmp_path / "precious"
    folder.begin(make_agent(), "agent", {}).close()
    precious.write_text("kept")
    (folder.path / name).unlink(missing_ok=True)
    (folder.path / name).symlink_to(precious)
    with pytest.raises(DrsError, match=name.strip(".") if name != ".lock" else "Cannot write"):
        folder.lock()
    assert precious.read_text() == "kept"


def test_a_pipe_in_the_place_of_a_lock_is_not_waited_for(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.begin(make_agent(), "agent", {}).close()
    (folder.path / ".lock").unlink()
    os.mkfifo(folder.path / ".lock")
    with pytest.raises(DrsError, match="Cannot write"):
        folder.lock()


def test_a_file_is_not_written_through_a_link_that_waits_for_it(tmp_path: Path) -> None:
    path, precious = tmp_path / "x.html", tmp_path / "precious"
    precious.write_text("kept")
    (tmp_path / f".x.html.{os.getpid()}.tmp").symlink_to(precious)
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new" and precious.read_text() == "kept" and not path.is_symlink()


def test_a_locked_run_can_be_locked_again_later(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.begin(make_agent(), "agent", {}).close()
    with folder.lock(), pytest.raises(UsageError, match="Another process"):
        folder.lock()
    folder.lock().close()
