"""What an update costs the tuner beside its rollouts: the tuning loop itself, with episodes made up beforehand."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.policy import Float32
from drs_core.rollouts import Progress, Task
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning

DIRECTIONS = (16, 1024)
_UPDATES = 4


class MadeUp:
    """The protocol `Rollouts`: returns that differ, at once."""

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """An episode a task."""
        return [Episode(task.seed, float(place), 1000, False, False, None, 0.1) for place, task in enumerate(tasks)]

    def close(self) -> None:
        """Nothing to free."""


class _Silent:
    def on_rollouts(self, update: int, done: int, total: int) -> None: ...

    def on_update(self, record: dict[str, Any]) -> None: ...

    def on_evaluation(self, record: dict[str, Any]) -> None: ...


def measure_search(agent: Agent, rounds: int) -> dict[str, float]:
    """CPU time of each direction of an update, and wall time of the rest [s], which waits for the disk."""
    found = {directions: [_update(agent, directions) for _ in range(rounds)] for directions in DIRECTIONS}
    few, most = DIRECTIONS
    cpu_few, cpu_most = (float(np.median([cpu_s for cpu_s, _ in found[directions]])) for directions in DIRECTIONS)
    direction_s = max(0.0, (cpu_most - cpu_few) / (most - few))
    # the least: whoever else uses the machine only adds to it
    return {
        "update_s": max(0.0, min(wall_s for _, wall_s in found[few]) - few * direction_s),
        "direction_s": direction_s,
    }


def _update(agent: Agent, directions: int) -> tuple[float, float]:
    """CPU and wall time of an update [s]."""
    config = tune_config({"updates": _UPDATES, "directions": directions, "evaluate_every": 0})
    with tempfile.TemporaryDirectory(prefix="drs-growth-") as folder:
        tuning = Tuning(agent, "growth", config, Path(folder) / "run")
        cpu, wall = time.process_time(), time.perf_counter()
        tuning.run(MadeUp(), _Silent())
        return (time.process_time() - cpu) / _UPDATES, (time.perf_counter() - wall) / _UPDATES
