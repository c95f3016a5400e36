"""A full disk and a folder that may not be written: a sentence, and a run that goes on afterwards."""

import itertools
import os
import subprocess

import pytest

from drs_core.errors import DrsError
from tests.conftest import drs, make_agent
from tests.test_killed import CONFIG, short_baseline  # noqa: F401
from tests.test_tuning import same, tune

PAGE_KB = 4
ROOM_KB = 4096


def mount(folder, *options):
    done = subprocess.run(["mount", *options, folder], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"a small disk needs the right to mount one: {done.stderr.strip()}")


@pytest.fixture
def disk(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    mount(folder, "-t", "tmpfs", "-o", f"size={ROOM_KB}k", "none")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


def resize(disk, kilobytes):
    mount(disk, "-o", f"remount,size={kilobytes}k")


def outcome(path):
    """What a run in a process of its own says: its error, or that it is done."""
    receiving, sending = os.pipe()
    child = os.fork()
    if child == 0:
        words = "something else"
        try:
            tune(make_agent(), path, config=CONFIG)
            words = "done"
        except DrsError as error:
            words = str(error)
        finally:
            os.write(sending, words.encode())
            os._exit(0)
    os.close(sending)
    _, status = os.waitpid(child, 0)
    assert status == 0
    with open(receiving) as pipe:
        return pipe.read()


def test_a_disk_that_is_full_at_any_moment_loses_nothing(disk, tmp_path):
    straight = tmp_path / "straight"
    tune(make_agent(), straight, config=CONFIG)
    said = []
    for size in itertools.count(PAGE_KB, PAGE_KB):
        path = disk / f"run_{size}"
        resize(disk, size)
        said.append(outcome(path))
        resize(disk, ROOM_KB)
        if path.exists():
            tune(make_agent(), path, config=CONFIG, resume=True)
            same(path, straight)
            subprocess.run(["rm", "-r", path], check=True)
        if said[-1] == "done":
            break
    assert len(said) > 5 and all("No space left" in words and "\n" not in words for words in said[:-1]), said


def test_the_command_line_on_a_full_disk(disk, tmp_path):
    agent = tmp_path / "agent.safetensors"
    agent.write_bytes(make_agent().to_bytes())
    settings = [agent, "--updates", 2, "--directions", 1, "--evaluate-every", 1, "--evaluation-episodes", 1]
    for size in (PAGE_KB, 4 * PAGE_KB):
        resize(disk, size)
        result = drs("tune", *settings, "--output", disk / f"run_{size}", "--workers", 1)
        assert result.returncode == 1 and "No space left" in result.stderr and "Traceback" not in result.stderr
    resize(disk, ROOM_KB)
    resumed = drs("tune", *settings, "--output", disk / f"run_{size}", "--workers", 1, "--resume")
    assert resumed.returncode == 0, resumed.stderr


def test_a_folder_that_may_not_be_written(disk, tmp_path):
    straight, path = tmp_path / "straight", disk / "run"
    tune(make_agent(), straight, config=CONFIG)
    tune(make_agent(), path, config=CONFIG, stop_after=1)
    mount(disk, "-o", "remount,ro")
    agent = tmp_path / "agent.safetensors"
    agent.write_bytes(make_agent().to_bytes())
    result = drs("tune", agent, "--output", disk / "new", "--workers", 1)
    assert result.returncode == 1 and "Traceback" not in result.stderr
    assert "Read-only file system" in result.stderr and "choose" in result.stderr
    with pytest.raises(DrsError, match="Read-only file system; choose"):
        tune(make_agent(), path, config=CONFIG, resume=True)
    mount(disk, "-o", "remount,rw")
    tune(make_agent(), path, config=CONFIG, resume=True)
    same(path, straight)
