"""Processes that are killed, and two commands in one folder: what is kept stays whole."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest

from tests.conftest import drs, refused

ASKED = "bench --sample-cost --rows PandaReach --methods top4 --seeds 2 --workers 2".split()


@pytest.fixture
def searching(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """The command, at work in `out` on both searches."""
    command = [sys.executable, "-m", "drs_core.cli", *ASKED, "--output", str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    family = []
    try:
        while sum(b"objectives" in path.read_bytes() for path in tmp_path.glob("out/*/top4/*.jsonl")) < 2:
            assert process.poll() is None
            time.sleep(0.05)
        family = psutil.Process(process.pid).children(recursive=True)
        yield process
    finally:
        process.kill()
        for child in filter(alive, family):
            child.kill()
        process.wait()
        if process.stderr:
            process.stderr.close()


def alive(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def workers(process: subprocess.Popen[str]) -> list[psutil.Process]:
    children = psutil.Process(process.pid).children()
    return [child for child in children if any("spawn_main" in word for word in child.cmdline())]


def test_workers_end_with_their_parent(searching: subprocess.Popen[str], tmp_path: Path):
    left = workers(searching)
    assert len(left) == 2
    searching.kill()
    searching.wait()
    until = time.monotonic() + 20
    while any(map(alive, left)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(alive, left))
    # and the folder is free
    again = drs(*ASKED, "--rollouts", 16, "--output", tmp_path / "out")
    assert again.returncode == 0 and "2 searches" not in again.stdout, again


def test_a_second_command_and_a_killed_worker_are_told_of(searching: subprocess.Popen[str], tmp_path: Path):
    second = drs(*ASKED, "--output", tmp_path / "out")
    refused(second, "Another process works in", "wait for it or choose another folder")
    assert searching.poll() is None
    workers(searching)[0].kill()
    _, said = searching.communicate(timeout=60)
    assert searching.returncode == 1 and "Traceback" not in said
    for word in ("was killed", "The records are kept", "fewer --workers"):
        assert word in " ".join(said.split())


@pytest.mark.skipif(find_spec("cma") is not None, reason="cma is installed")
def test_a_library_that_is_missing_is_told_before_anything_runs(tmp_path: Path):
    out = tmp_path / "out"
    wanted = "bench --sample-cost --rows PandaReach --methods top4,sep_cma --seeds 1".split()
    refused(drs(*wanted, "--output", out), "sep-CMA-ES (cma) needs cma; install it", "[peers]")
    assert not list(out.rglob("*.jsonl"))
