"""A run that is put to sleep, and clocks that jump: the same bytes."""

import os
import random
import signal
import subprocess
import sys
import time

import psutil
import pytest

from tests.conftest import make_agent
from tests.test_tuning import CONFIG, records, same, tune

SETTINGS = ["--updates", 12, "--directions", 2, "--evaluate-every", 2, "--evaluation-episodes", 2, "--workers", 2]


def start(agent, output):
    command = [sys.executable, "-m", "drs_core.cli", "tune", agent, "--output", output, *map(str, SETTINGS)]
    return subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def wait_for(condition, patience_s=60.0):
    end = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def sleep(whom, run, history, asleep_s):
    wait_for(lambda: history.exists() and history.stat().st_size)
    search = psutil.Process(run.pid)
    workers = search.children(recursive=True)
    chosen = {"all": [search, *workers], "a worker": workers[-1:], "the search": [search]}[whom]
    assert chosen and run.poll() is None, "the run was over too soon"
    for process in chosen:
        process.send_signal(signal.SIGSTOP)
    wait_for(lambda: all(process.status() == psutil.STATUS_STOPPED for process in chosen))
    time.sleep(asleep_s)
    for process in chosen:
        process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("asleep_s", [2.0, pytest.param(30.0, marks=pytest.mark.soak)])
@pytest.mark.parametrize("whom", ["all", "a worker", "the search"])
def test_asleep_in_the_middle_of_a_run(tmp_path, whom, asleep_s):
    agent = tmp_path / "agent.safetensors"
    agent.write_bytes(make_agent().to_bytes())
    straight, asleep = start(agent, tmp_path / "straight"), start(agent, tmp_path / "asleep")
    sleep(whom, asleep, tmp_path / "asleep" / "history.jsonl", asleep_s)
    for run in (straight, asleep):
        assert run.wait(timeout=120) == 0, run.stderr.read()
    same(tmp_path / "asleep", tmp_path / "straight")
    assert [record["update"] for record in records(tmp_path / "asleep")] == list(range(1, 13))


def test_a_clock_that_jumps(tmp_path, monkeypatch):
    tune(make_agent(), tmp_path / "straight", config=CONFIG)
    rng = random.Random(0)
    # forth and back by up to a year, at every look
    monkeypatch.setattr(time, "time", lambda: 1.7e9 + rng.uniform(-3e7, 3e7))
    tune(make_agent(), tmp_path / "jumping", config=CONFIG, stop_after=3)
    os.utime(tmp_path / "jumping" / "agent.safetensors", (0, 0))
    tune(make_agent(), tmp_path / "jumping", config=CONFIG, resume=True)
    same(tmp_path / "jumping", tmp_path / "straight")
