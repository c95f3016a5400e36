"""Episodes of an evaluation that are kept on disk: asked for again they are read, asked for more they are added to."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core import versions
from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.evaluation import evaluate
from drs_core.files import parse_json, read_bounded, write_atomically
from drs_core.reproduce.paper import DIMENSION, FAILURE, RETURN
from drs_core.rollouts import Progress, Rollouts
from drs_core.versions import Part

MAX_BYTES = 2**28
_PARTS, _COUNTER = "made_with", "episode"


@dataclass(frozen=True)
class Kept:
    """What one agent did on the seeds from 0 on.

    Attributes:
        digest: of the agent.
        backend: what ran the episodes.
        wall_s: how long they took.
        columns: a number an episode, under the names of the paper's quantities.
        made_with: which versions ran the episodes, each from which one on.
    """

    digest: str
    backend: str
    wall_s: float = 0.0
    columns: dict[str, list[float]] = field(default_factory=lambda: {RETURN: [], FAILURE: [], DIMENSION: []})
    made_with: tuple[Part, ...] = ()

    @property
    def episodes(self) -> int:
        """How many there are."""
        return len(self.columns[RETURN])

    def values(self, quantity: str, episodes: int) -> NDArray[np.float64]:
        """The first episodes' numbers, (episodes,) float64; failures are 0 or 100."""
        return np.array(self.columns[quantity][:episodes], dtype=np.float64)


def read(path: Path) -> Kept | None:
    """What is kept, None where nothing is.

    Raises:
        UsageError: the file is damaged.
    """
    if not path.exists():
        return None
    content = parse_json(read_bounded(path, MAX_BYTES), str(path))
    if not _is_kept(content):
        raise UsageError(f"{path} is damaged; remove it, and its episodes are run again.")
    # files of earlier versions do not say it
    parts = versions.read(content.pop(_PARTS, [{_COUNTER: 0}]), _COUNTER) or []
    return Kept(**content, made_with=tuple(parts))


def _is_kept(content: Any) -> bool:
    kinds = {"digest": str, "backend": str, "wall_s": (int, float), "columns": dict}
    if not isinstance(content, dict) or set(content) - {_PARTS} != set(kinds):
        return False
    if _PARTS in content and not versions.read(content[_PARTS], _COUNTER):
        return False
    if not all(isinstance(content[name], kind) for name, kind in kinds.items()):  # type: ignore[arg-type]
        return False
    columns = content["columns"]
    if set(columns) != {RETURN, FAILURE, DIMENSION} or not all(isinstance(c, list) for c in columns.values()):
        return False
    numbers = [value for column in columns.values() for value in column]
    finite = all(type(value) in (int, float) and math.isfinite(value) for value in numbers)
    return finite and len({len(column) for column in columns.values()}) == 1


def keep(
    path: Path, agent: Agent, backend: str, rollouts: Rollouts, episodes: int, progress: Progress | None = None
) -> Kept:
    """Run what is missing of the first `episodes` seeds; another agent's episodes make way."""
    there = read(path)
    if there is None or (there.digest, there.backend) != (agent.digest(), backend):
        there = Kept(agent.digest(), backend)
    if there.episodes >= episodes:
        return there
    found = evaluate(path.stem, agent, rollouts, episodes - there.episodes, there.episodes, progress)
    new = {
        RETURN: found.returns,
        FAILURE: found.column(lambda episode: 100.0 * episode.failed),
        DIMENSION: found.column(lambda episode: episode.dimension.mean() if episode.dimension else math.nan),
    }
    columns = {name: there.columns[name] + values.tolist() for name, values in new.items()}
    parts = tuple(versions.extended(there.made_with, there.episodes, versions.installed()))
    kept = Kept(there.digest, backend, there.wall_s + found.wall_s, columns, parts)
    content = vars(kept) | {_PARTS: versions.kept(parts, _COUNTER)}
    write_atomically(path, json.dumps(content, allow_nan=False).encode())
    return kept
