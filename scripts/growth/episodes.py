"""Measured durations of an update's episodes, the file that keeps them, and draws from them."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from drs_core.agent import Agent
from drs_core.files import write_atomically
from drs_core.rollouts import InProcess, Task
from drs_core.search import SearchConfig, ask

_HEADS = ("agent", "direction", "sign", "steps", "duration_s")


@dataclass(frozen=True)
class Timed:
    """One episode: of which agent, direction and sign (+1, -1), its steps, and its CPU time [s]."""

    agent: str
    direction: int
    sign: int
    steps: int
    duration_s: float


def measure_episodes(name: str, agent: Agent, directions: int) -> list[Timed]:
    """The first update of the paper's settings with this many directions, one episode after the other.

    CPU time, since whoever else uses the machine would be in the wall time.
    """
    found = []
    with closing(InProcess(agent)) as rollouts:
        rollouts.run(agent.theta, [Task(0)])
        (tasks,) = asked(SearchConfig(directions=directions), 1)
        for task in tasks:
            start = time.process_time()
            (episode,) = rollouts.run(agent.theta, [task])
            duration_s = round(time.process_time() - start, 5)
            side = task.perturbation
            found.append(Timed(name, side.direction, side.sign, episode.length, duration_s))
    return found


def asked(config: SearchConfig, updates: int) -> list[list[Task]]:
    """The rollouts of each of the first updates of a search."""
    return [
        [Task(seed, perturbation=perturbation) for perturbation, seed in ask(config, update)]
        for update in range(updates)
    ]


def save_episodes(path: Path, episodes: Sequence[Timed]) -> None:
    """Write a line an episode."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_HEADS)
    writer.writerows(astuple(episode) for episode in episodes)
    write_atomically(path, text.getvalue().encode())


def load_episodes(path: Path) -> dict[str, list[tuple[float, ...]]]:
    """Agent -> durations of both sides of each direction [s]."""
    pairs: dict[str, dict[str, list[float]]] = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            sides = pairs.setdefault(row["agent"], {}).setdefault(row["direction"], [])
            sides.append(float(row["duration_s"]))
    return {agent: [tuple(sides) for sides in found.values()] for agent, found in pairs.items()}


def draw(pairs: Sequence[tuple[float, ...]], directions: int, updates: int, seed: int) -> list[list[float]]:
    """Durations of `updates` updates [s], 2 * directions each: directions drawn with replacement, both sides together.

    Both sides have one episode seed, so their durations belong together.
    """
    rng = np.random.default_rng(seed)
    return [
        [side for index in rng.integers(len(pairs), size=directions) for side in pairs[index]] for _ in range(updates)
    ]
