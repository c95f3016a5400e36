"""An agent is shown what was recorded; its actions are compared with the recorded ones."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from drs_core.errors import UsageError
from drs_core.recording.definitions import ACTION, ACTION_TYPE, OBSERVATION, OBSERVATION_TYPE
from drs_core.recording.replay import replay, summary
from drs_core.recording.writer import RecordingWriter
from tests.conftest import drs, make_agent, refused
from tests.recording.conftest import actions_of, observation_bytes, write


def test_the_agent_that_acted_acts_again_bit_for_bit(recording: Path) -> None:
    result = replay(recording, make_agent())
    np.testing.assert_array_equal(result.recorded, result.replayed)
    found = summary(result)
    assert found["actions"] == found["equal"] == 60 and found["difference_max"] == 0.0
    assert found["unanswered"] == 0 and found["complete"] and found["topic"] == "/observation"
    np.testing.assert_allclose(result.times_s, 0.04 * np.arange(60))


def test_differences_are_told_where_they_are(tmp_path: Path) -> None:
    agent = make_agent()
    actions = actions_of(agent, 30)
    # rounded to float32 as a message has it
    actions[20] += np.float32(0.25)
    found = summary(replay(write(tmp_path / "a.mcap", agent, actions), agent))
    assert found["equal"] == 29
    assert found["difference_max"] == pytest.approx(0.25, abs=1e-6)
    assert found["difference_mean"] == pytest.approx(0.25 / 30, abs=1e-6)
    assert found["difference_max_at_s"] == pytest.approx(0.8)


def test_another_agent_differs(recording: Path) -> None:
    assert summary(replay(recording, make_agent(seed=1)))["equal"] < 10


def test_a_recording_that_breaks_off_is_replayed_as_far_as_it_goes(recording: Path, tmp_path: Path) -> None:
    content = recording.read_bytes()
    short = tmp_path / "short.mcap"
    short.write_bytes(content[:-200])
    found = summary(replay(short, make_agent()))
    assert not found["complete"] and found["actions"] == found["equal"] == 60


def test_what_does_not_fit_is_refused(recording: Path, tmp_path: Path) -> None:
    agent = make_agent()
    with pytest.raises(UsageError, match=r"is of 'MountainCarContinuous-v0', the agent of Pendulum-v1"):
        replay(recording, make_agent("Pendulum-v1"))
    with pytest.raises(UsageError, match="it has them on /observation"):
        replay(recording, agent, "/elsewhere")
    only = write(tmp_path / "only.mcap", agent, actions_of(agent, 3), topics="o")
    with pytest.raises(UsageError, match=r"observations on /observation, with actions beside them on none; record"):
        replay(only, agent)
    with pytest.raises(UsageError, match="no topic"):
        replay(write(tmp_path / "none.mcap", agent, actions_of(agent, 3), topics="a"), agent)
    with pytest.raises(UsageError, match="is not a file"):
        replay(tmp_path / "absent.mcap", agent)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_action_that_is_not_finite_is_refused(tmp_path: Path, value: float) -> None:
    agent, file = make_agent(), tmp_path / "agent.safetensors"
    actions = actions_of(agent, 3)
    actions[1] = value
    path = write(tmp_path / "a.mcap", agent, actions)
    with pytest.raises(UsageError, match="has an action that is not finite"):
        replay(path, agent)
    agent.save(file)
    for more in ((), ("--json",)):
        done = drs("replay", path, file, *more)
        refused(done, "has an action that is not finite")
        assert done.returncode == 2 and "Warning" not in done.stderr


@pytest.mark.filterwarnings("error")
def test_numbers_at_the_ends_of_their_ranges(tmp_path: Path) -> None:
    agent, path = make_agent(), tmp_path / "a.mcap"
    largest = np.full((4, 1), np.finfo(np.float32).max)
    largest[::2] *= -1.0
    found = summary(replay(write(path, agent, largest.astype(np.float32)), agent))
    json.dumps(found, allow_nan=False)
    assert found["action_change_recorded"] == pytest.approx(2.0 * float(largest[1, 0]))
    for value in (1e39, 1.7e308, np.nan, -np.inf):
        with RecordingWriter(path) as writer:
            writer.add_topic("/observation", OBSERVATION_TYPE, OBSERVATION)
            writer.add_topic("/action", ACTION_TYPE, ACTION)
            writer.write("/observation", observation_bytes(agent, 1, values=[0.0, value]), 1, 1)
        with pytest.raises(UsageError, match="an observation that is not finite, or beyond float32"):
            replay(path, agent)


def test_the_command_prints_one_json_object_and_draws(recording: Path, tmp_path: Path) -> None:
    agent, figure = tmp_path / "agent.safetensors", tmp_path / "actions.png"
    make_agent().save(agent)
    done = drs("replay", recording, agent, "--json", "--figure", figure)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["equal"] == 60 and found["figure"] == str(figure)
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "60 of them, bit for bit" in " ".join(drs("replay", recording, agent).stdout.split())
    refused(drs("replay", recording, agent, "--figure", figure), "exists already")
    refused(drs("replay", agent, agent), "not an MCAP recording")
    refused(drs("record", "-o", tmp_path / "x.bag"), "*.mcap")
    refused(drs("record", "-o", tmp_path / "x.mcap", "--seconds", "0"), "--seconds is 0")
