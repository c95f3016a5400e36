"""What a policy saw, as rows of features: from episodes or a recording, few enough to ask every candidate about."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import closing
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as from_safetensors
from safetensors.numpy import save as to_safetensors

from drs_core.agent import Agent
from drs_core.episode import SEEN, EpisodeRunner
from drs_core.errors import DrsError, UsageError
from drs_core.files import read_bounded
from drs_core.policy import Float32
from drs_core.run_folder import RunFolder
from drs_core.search import baseline_seeds

MOST = 256
EPISODES = 8
"""Of the agent that a run begins with, where there is no recording."""
EPISODES_SOURCE, RECORDING_SOURCE = "episodes", "recording"
_NAME = "seen"
_HEADER_BYTES = 4096

Observe = Callable[[], Float32]


class Thinned:
    """Rows from a stream of unknown length: every k-th, k doubled whenever too many are kept."""

    def __init__(self, most: int = MOST) -> None:
        """Keep `most` at the end, and twice as many meanwhile."""
        self._most, self._every, self._count = most, 1, 0
        self._rows: list[Float32] = []

    def add(self, row: Float32) -> None:
        """Take the next row (n_features,); it is copied where it is kept."""
        if self._count % self._every == 0:
            self._rows.append(row.copy())
            if len(self._rows) == 2 * self._most:
                self._rows, self._every = self._rows[::2], 2 * self._every
        self._count += 1

    def rows(self) -> Float32:
        """(at most `most`, n_features) float32, evenly spread over the stream."""
        places = np.linspace(0, len(self._rows) - 1, min(self._most, len(self._rows))).round().astype(int)
        return np.array([self._rows[place] for place in places], dtype=np.float32)


def of_episodes(agent: Agent, seed: int) -> Float32:
    """What the agent sees in EPISODES episodes in this process, (at most MOST, n_features) float32.

    Raises:
        DrsError: its environment cannot be made here.
    """
    thinned = Thinned()
    try:
        runner = EpisodeRunner(agent)
    except DrsError as error:
        raise DrsError(
            f"action_change_max needs observations, and none can be made here: {error} Or give a recording."
        ) from error
    with closing(runner):
        runner.load(agent.theta)
        for episode_seed in baseline_seeds(seed, EPISODES):
            seen = runner.run(episode_seed, frozenset({SEEN})).seen
            for row in seen if seen is not None else ():
                thinned.add(row)
    return thinned.rows()


def given(folder: RunFolder, observe: Observe | None, action_change_max: float, resume: bool) -> Float32 | None:
    """What a recording gives to a run that keeps no observations yet; None where nothing is to be read.

    Raises:
        UsageError: the recording cannot be used, or the run has no use for it.
    """
    if observe is None:
        return None
    if not action_change_max:
        raise UsageError("observations are given, but action_change_max is 0: give it too, or neither.")
    kept = resume and folder.exists() and folder.observations_facts() is not None
    return None if kept else observe()


def packed(rows: Float32, source: str) -> tuple[bytes, dict[str, Any]]:
    """Rows (n, n_features) as the file of a run, and what its run.json says of it."""
    content = to_safetensors({_NAME: rows})
    return content, {"source": source, "count": len(rows), "sha256": hashlib.sha256(content).hexdigest()}


def of_run(folder: RunFolder, start: Agent, seed: int) -> Float32:
    """The observations of a run, the same for as long as it lives: kept in its folder, or from episodes and kept now.

    Args:
        folder: of the run.
        start: the agent that the run began with.
        seed: of the run.

    Raises:
        UsageError: what is kept is damaged, or gone.
        DrsError: there are none, and none can be made.
    """
    facts = folder.observations_facts()
    if facts is None:
        rows = of_episodes(start, seed)
        folder.keep_observations(*packed(rows, EPISODES_SOURCE))
        return rows
    return _read(folder, start, facts["sha256"])


def _read(folder: RunFolder, agent: Agent, digest: str) -> Float32:
    path, size = folder.observations, agent.pipeline.size
    content = read_bounded(path, _HEADER_BYTES + 4 * MOST * size)
    if hashlib.sha256(content).hexdigest() != digest:
        raise UsageError(f"{path} is not what the run kept there; put the right file back or choose a new folder.")
    try:
        rows = from_safetensors(content)[_NAME]
    except (SafetensorError, KeyError, ValueError, TypeError) as error:
        raise UsageError(f"{path} holds no observations: {error}.") from error
    if rows.dtype != np.float32 or rows.ndim != 2 or not len(rows) or rows.shape[1] != size:
        raise UsageError(f"{path} holds {rows.dtype} {rows.shape}; the policy sees float32 (n, {size}).")
    if not np.isfinite(rows).all():
        raise UsageError(f"{path} holds observations that are not finite.")
    return rows
