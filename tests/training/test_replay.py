"""A replay buffer filled from its files is the one that was written, wherever it wrapped around."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("torch")
gymnasium = pytest.importorskip("gymnasium")

from stable_baselines3 import HerReplayBuffer  # noqa: E402
from stable_baselines3.common.buffers import ReplayBuffer  # noqa: E402

from drs_core.errors import UsageError  # noqa: E402
from drs_core.training import replay  # noqa: E402

BOX = gymnasium.spaces.Box(-1, 1, (2,), np.float32)
GOALS = gymnasium.spaces.Dict({"achieved_goal": BOX, "desired_goal": BOX, "observation": BOX})


class Files:
    """Segments in memory, as the training folder keeps them on disk."""

    def __init__(self):
        self.arrays, self.segments, self.end = {}, [], 0

    def save(self, buffer, added):
        end = replay.usable_rows(buffer, added)
        if end > self.end:
            first, rows = replay.new_rows(buffer, self.end, end)
            self.segments.append(replay.Segment(f"{len(self.arrays)}", first, end - first))
            self.arrays[self.segments[-1].file] = rows
        self.end = end
        self.segments = replay.still_needed(self.segments, buffer, end)

    def restore(self, buffer):
        replay.restore(buffer, self.segments, self.end, self.arrays.__getitem__)


def make(hindsight, size):
    return HerReplayBuffer(size, GOALS, BOX, env=None, device="cpu") if hindsight else ReplayBuffer(size, BOX, BOX)


def add(buffer, rng, done):
    def one():
        return rng.uniform(-1, 1, (1, 2)).astype(np.float32)

    seen = [{key: one() for key in GOALS} if hasattr(buffer, "ep_start") else one() for _ in range(2)]
    buffer.add(*seen, one(), rng.normal(size=1), np.array([done]), [{"TimeLimit.truncated": bool(done)}])


@settings(max_examples=80, deadline=None)
@given(
    hindsight=st.booleans(),
    size=st.integers(13, 40),
    episodes=st.lists(st.tuples(st.integers(1, 12), st.booleans()), min_size=1, max_size=12),
    cut=st.integers(0, 11),
)
def test_restored_buffer_equals_the_one_saved(hindsight, size, episodes, cut):
    rng, files, buffer, added = np.random.default_rng(0), Files(), make(hindsight, size), 0
    for length, save_inside in episodes:
        for step in range(length):
            add(buffer, rng, step == length - 1)
            added += 1
            if save_inside and step == length // 2:
                files.save(buffer, added)
    files.save(buffer, added)
    restored = make(hindsight, size)
    files.restore(restored)
    for (name, expected), (_, found) in zip(replay._columns(buffer), replay._columns(restored), strict=True):
        np.testing.assert_array_equal(found, expected, err_msg=name)
    assert (restored.pos, restored.full) == (buffer.pos, buffer.full)
    if hindsight:
        np.testing.assert_array_equal(restored.ep_length, buffer.ep_length)
        np.testing.assert_array_equal(restored._current_ep_start, buffer._current_ep_start)
        # an episode that was not over is left out, and the next one takes its place
        for _ in range(cut):
            add(buffer, rng, False)
        files.save(buffer, added + cut)
        assert files.end == added


def test_rows_of_another_buffer_are_refused():
    rng, files, buffer = np.random.default_rng(0), Files(), make(False, 20)
    add(buffer, rng, True)
    files.save(buffer, 1)
    with pytest.raises(UsageError, match="not of this training"):
        files.restore(make(True, 20))
