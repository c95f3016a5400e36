"""Mistakes about where results go and about settings are told before any work, and leave nothing in the way."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.files import check_writable
from drs_core.tune_config import tune_config
from tests.conftest import drs, refused
from tests.test_tuning import tune

START = "from drs_core.start import main; main()"


def test_a_folder_is_no_output_however_much_it_is_forced(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is a folder; name a file"):
        check_writable(tmp_path, force=True)
    with pytest.raises(UsageError, match="choose a folder that you may write"):
        check_writable(Path("/proc/new.csv"), force=False)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("content", "words"), [(b"a page without marks", "has no lines"), (b"\xff\xfe", "is not a page of text")]
)
def test_a_page_that_cannot_take_the_tables_is_found_before_they_are_measured(
    tmp_path: Path, content: bytes, words: str
) -> None:
    page = tmp_path / "page.md"
    page.write_bytes(content)
    result = drs("bench", "--environments", "MountainCar", "--rounds", 1, "--markdown", page, timeout=20)
    refused(result, words)
    assert result.returncode == 2 and page.read_bytes() == content


def test_a_run_folder_says_what_is_wrong_with_it(agent: Agent, tmp_path: Path) -> None:
    agent_file = tmp_path / "agent.safetensors"
    agent.save(agent_file)
    options = ("--workers", 0, "--updates", 2, "--directions", 1, "--evaluate-every", 0, "--resume")
    run = tmp_path / "run"
    tune(agent, run)
    # alpha and sigma were not given: they follow from the objective
    refused(drs("tune", agent_file, "--output", run, *options, "--objective", "smooth"), "objective = return")
    (run / "run.json").unlink()
    refused(drs("tune", agent_file, "--output", run, *options), "cannot be continued without run.json")
    result = drs("tune", agent_file, "--output", agent_file, *options)
    refused(result, "a file is there")
    assert result.returncode == 2


def test_what_is_an_agent_already_needs_no_import(tmp_path: Path) -> None:
    for source in ("panda_reach", "runs/seed0/agent.safetensors"):
        refused(drs("import", source, "-o", tmp_path / "x.safetensors"), f"{source} needs no import", "drs evaluate")


def test_a_weight_leaves_objectives_finite() -> None:
    assert tune_config({"objective": "smooth", "smoothness_weight": 1e9}).objective.smoothness_weight == 1e9
    with pytest.raises(UsageError, match=r"smoothness_weight is 1e\+10; allowed are 0 .* to 1e\+09"):
        tune_config({"objective": "smooth", "smoothness_weight": 1e10})


def test_a_weight_that_would_do_nothing_is_refused() -> None:
    for values in ({}, {"objective": "dimension"}):
        with pytest.raises(UsageError, match=r"smoothness_weight is 5, and the objective .* has no weight"):
            tune_config({**values, "smoothness_weight": 5.0})
    # so a parameter that is not set stands in ROS
    assert tune_config({"smoothness_weight": 0.0}).objective.smoothness_weight is None


def test_ctrl_c_while_the_command_still_imports_is_quiet() -> None:
    command = [sys.executable, "-c", START, "evaluate", "panda_reach", "--episodes", "10000", "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    maps = Path(f"/proc/{process.pid}/maps")
    while "numpy" not in maps.read_text():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=20)
    assert (process.returncode, stdout) == (130, "") and "Traceback" not in stderr
