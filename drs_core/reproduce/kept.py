"""Episodes of an evaluation that are kept on disk: asked for again they are read, asked for more they are added to."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.evaluation import evaluate
from drs_core.files import parse_json, read_bounded, write_atomically
from drs_core.reproduce.paper import DIMENSION, FAILURE, RETURN
from drs_core.rollouts import Progress, Rollouts

MAX_BYTES = 2**28


@dataclass(frozen=True)
class Kept:
    """What one agent did on the seeds from 0 on.

    Attributes:
        digest: of the agent.
        backend: what ran the episodes.
        wall_s: how long they took.
        columns: a number an episode, under the names of the paper's quantities.
    """

    digest: str
    backend: str
    wall_s: float = 0.0
    columns: dict[str, list[float]] = field(default_factory=lambda: {RETURN: [], FAILURE: [], DIMENSION: []})

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
    return Kept(**content)


def _is_kept(content: Any) -> bool:
    kinds = {"digest": str, "backend": str, "wall_s": (int, float), "columns": dict}
    if not isinstance(content, dict) or set(content) != set(kinds):
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
    kept = Kept(there.digest, backend, there.wall_s + found.wall_s, columns)
    write_atomically(path, json.dumps(asdict(kept), allow_nan=False).encode())
    return kept
