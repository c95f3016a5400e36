"""kill -9 wherever a run touches its folder, also in the middle of a write: it resumes as if nothing had been."""

import itertools
import json
import os
import signal
import stat
import sys
from pathlib import Path
from typing import NoReturn

import pytest

from drs_core import json_lines
from drs_core.objective import Objective
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from tests.conftest import make_agent
from tests.test_tuning import records, same, tune

CONFIG = TuneConfig(
    SearchConfig(updates=2, directions=1, alpha=(0.3, 0.1), sigma=(0.3, 0.1), seed=7),
    objective=Objective("smooth"),
    evaluate_every=1,
    evaluation_episodes=1,
    back_off=True,
)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
CALLS = {"os.rename", "os.mkdir", "os.remove", "os.truncate"}
"""What the interpreter tells of before it does it; an open file and an fsync are looked at apart."""
MOST = 400
TAIL = 5
"""Bytes that a half-written file lacks."""


def killed_at(point: int, path: Path, resume: bool = False) -> bool:
    """Run in a child that dies before its `point`-th touch of the folder; false where it ended before."""
    child = os.fork()
    if child == 0:
        _run_and_die(point, path, resume)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return True
    assert os.waitstatus_to_exitcode(status) == 0
    return False


def _die(half_written: int | None) -> None:
    if half_written is not None:
        os.ftruncate(half_written, max(os.fstat(half_written).st_size - TAIL, 0))
    os.kill(os.getpid(), signal.SIGKILL)


def _run_and_die(point: int, path: Path, resume: bool) -> NoReturn:
    count, fsync = 0, os.fsync

    def touch(half_written: int | None = None) -> None:
        nonlocal count
        count += 1
        if count == point:
            _die(half_written)

    def hook(event: str, arguments: tuple) -> None:
        if event == "open":
            name, _, flags = arguments
            if isinstance(name, (str, os.PathLike)) and str(path) in str(name) and flags & WRITING:
                touch()
        elif event in CALLS and str(path) in str(arguments[0]):
            touch()

    def counting_fsync(descriptor: int) -> None:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            touch(half_written=descriptor)
        touch()
        fsync(descriptor)

    try:
        os.fsync = counting_fsync
        sys.addaudithook(hook)
        tune(make_agent(), path, config=CONFIG, resume=resume)
        os._exit(0)
    except BaseException:
        import traceback

        traceback.print_exc()
        os._exit(1)


@pytest.fixture(autouse=True)
def short_baseline(monkeypatch):
    monkeypatch.setattr("drs_core.tuning.BASELINE_EPISODES", 2)
    monkeypatch.setattr("drs_core.backing_off.WINDOW", 1)


def test_every_point_of_a_run(tmp_path):
    straight = tmp_path / "straight"
    tune(make_agent(), straight, config=CONFIG)
    # it gets lost on the way
    assert [record.get("backed_off") for record in json_lines.read(straight / "history.jsonl")] == [None, 1]
    for point in itertools.count(1):
        path = tmp_path / f"killed_{point:03}"
        if not killed_at(point, path):
            break
        tune(make_agent(), path, config=CONFIG, resume=True)
        same(path, straight)
        assert [record["update"] for record in records(path)] == [1, 2]
        assert [record["update"] for record in json_lines.read(path / "evaluations.jsonl")] == [0, 1, 2]
        assert not list(path.glob(".*.tmp")), point
    # run.json twice, and for each update a line and two agents, each with several touches
    assert 40 < point < MOST
    print(f"{point - 1} points")


def test_a_resume_under_other_versions_is_told_of_once_wherever_it_is_killed(tmp_path, monkeypatch):
    straight = tmp_path / "straight"
    tune(make_agent(), straight, config=CONFIG)
    whole = json.loads((straight / "run.json").read_text())
    now = {**whole["versions"], "numpy": "0.1"}
    for point in itertools.count(1):
        path = tmp_path / f"killed_{point:03}"
        tune(make_agent(), path, config=CONFIG, stop_after=1)
        with monkeypatch.context() as other:
            other.setattr("drs_core.tuning.installed", lambda: now)
            if not killed_at(point, path, resume=True):
                break
            tune(make_agent(), path, config=CONFIG, resume=True)
        kept = json.loads((path / "run.json").read_text())
        assert kept == whole | {"resumed_with": [{"update": 1, "versions": now}]}, point
        (path / "run.json").write_text(json.dumps(whole))
        same(path, straight)
        assert not list(path.glob(".*.tmp")), point
    assert 20 < point < MOST


def test_killed_again_and_again_while_it_resumes(tmp_path):
    straight, path = tmp_path / "straight", tmp_path / "killed"
    tune(make_agent(), straight, config=CONFIG)
    killed = sum(killed_at(point, path, resume=True) for point in (1, 4, 7, 11, 16, 22, 9, 5, 13))
    assert killed > 5
    tune(make_agent(), path, config=CONFIG, resume=True)
    same(path, straight)
