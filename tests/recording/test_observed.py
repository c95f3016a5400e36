"""What a policy saw, taken from a recording: the features of an episode, few, and none that do not fit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from drs_core.errors import UsageError
from drs_core.observed import MOST
from drs_core.recording.observed import of_recording
from tests.conftest import drs, make_agent, refused
from tests.recording.conftest import actions_of, write


def test_they_are_what_the_policy_saw(recording: Path) -> None:
    agent = make_agent()
    rows = of_recording(recording, agent)
    assert rows.shape == (60, 2) and rows.dtype == np.float32
    policy = agent.policy()
    np.testing.assert_array_equal([policy.act(row) for row in rows], actions_of(agent, 60))


def test_a_long_recording_gives_few(tmp_path: Path) -> None:
    agent = make_agent()
    long = write(tmp_path / "long.mcap", agent, actions_of(agent, 2 * MOST + 88))
    assert len(of_recording(long, agent)) == MOST


def test_what_does_not_fit_is_refused(recording: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"is of 'MountainCarContinuous-v0', the agent of Pendulum-v1"):
        of_recording(recording, make_agent("Pendulum-v1"))
    with pytest.raises(UsageError, match="is not a file"):
        of_recording(tmp_path / "absent.mcap", make_agent())
    make_agent().save(tmp_path / "other.mcap")
    with pytest.raises(UsageError, match="not an MCAP recording"):
        of_recording(tmp_path / "other.mcap", make_agent())


def test_the_command_takes_a_recording_and_keeps_what_it_took(recording: Path, tmp_path: Path) -> None:
    agent, run = tmp_path / "agent.safetensors", tmp_path / "run"
    make_agent().save(agent)
    common = ("tune", agent, "--output", run, "--workers", 0, "--updates", 2, "--directions", 2, "--evaluate-every", 0)
    capped = (*common, "--action-change-max", 0.05, "--observations", recording)
    refused(drs(*common, "--observations", recording), "action_change_max is 0")
    refused(drs(*capped[:-1], agent), "not an MCAP recording")
    assert not run.exists()
    done = drs(*capped, "--stop-after", 1, "--json")
    assert done.returncode == 0, done.stderr
    kept = json.loads((run / "run.json").read_text())["observations"]
    assert (kept["source"], kept["count"]) == ("recording", 60)
    recording.unlink()
    assert drs(*capped, "--resume", "--json").returncode == 0
    sigmas = [json.loads(line)["sigma"] for line in (run / "history.jsonl").read_text().splitlines()]
    assert len(sigmas) == 2 and 0.0 < max(sigmas) < 0.025
