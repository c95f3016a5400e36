"""Observations are thinned evenly, the same for as long as a run lives, and refused where they were touched."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.observed import RECORDING_SOURCE, Thinned, of_episodes, of_run, packed
from drs_core.run_folder import RunFolder
from tests.conftest import make_agent


@given(st.integers(1, 700), st.integers(2, 40))
def test_thinning_keeps_few_of_any_stream_evenly(length, most):
    thinned = Thinned(most)
    for number in range(length):
        thinned.add(np.full(2, number, np.float32))
    rows = thinned.rows()
    assert rows.dtype == np.float32 and rows.shape == (min(most, length), 2) and rows[0, 0] == 0
    if length <= most:
        assert rows[:, 0].tolist() == list(range(length))
    else:
        gaps = np.diff(np.append(rows[:, 0], length))
        assert gaps.min() >= 1 and gaps.max() <= 4 * length / most


@pytest.fixture
def folder(tmp_path, agent):
    folder = RunFolder(tmp_path / "run")
    folder.begin(agent, "agent", {}).close()
    return folder


def test_a_run_keeps_what_it_began_with(folder, agent):
    rows = of_run(folder, agent, 3)
    assert rows.tobytes() == of_episodes(agent, 3).tobytes() and len(rows) == 256
    assert folder.observations_facts()["source"] == "episodes"
    # whatever seed is asked for later
    assert of_run(folder, agent, 4).tobytes() == rows.tobytes()


def test_what_a_recording_gives_is_kept(folder, agent):
    rows = of_episodes(agent, 3)[:7]
    folder.keep_observations(*packed(rows, RECORDING_SOURCE))
    assert of_run(folder, agent, 3).tobytes() == rows.tobytes()
    assert folder.observations_facts()["source"] == "recording"


def test_what_was_touched_is_refused(folder, agent):
    of_run(folder, agent, 3)
    content = folder.observations.read_bytes()
    folder.observations.write_bytes(content[:-1] + b"x")
    with pytest.raises(UsageError, match="not what the run kept"):
        of_run(folder, agent, 3)
    folder.observations.write_bytes(content + bytes(10**6))
    with pytest.raises(UsageError, match="larger than"):
        of_run(folder, agent, 3)
    folder.observations.unlink()
    with pytest.raises(UsageError, match="not a file"):
        of_run(folder, agent, 3)
    other = make_agent("Pendulum-v1")
    folder.observations.write_bytes(content)
    with pytest.raises(UsageError, match=r"float32 \(n, 3\)"):
        of_run(folder, other, 3)
