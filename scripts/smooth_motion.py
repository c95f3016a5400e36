"""What `smooth` does to agents, beside its two controls: the plain return, and random moves as long as `smooth`'s.

With `--action-gains` a third one: all gains times a factor.

    python scripts/smooth_motion.py panda_push --runs runs/smooth -- --alpha 0.01 0.005 > rows.csv

What follows -- is for `drs tune`. Each run is kept, and the same command goes on.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from drs_core.agent import Agent, load
from drs_core.importing import resolve
from drs_core.tune_config import SHORT_SCHEDULE

BUDGET = ("--updates", "20", "--directions", "16", "--evaluate-every", "0")
"""640 rollouts."""
SCHEDULE = [word for name, ends in SHORT_SCHEDULE.items() for word in (f"--{name}", *map(str, ends))]
"""The same for both objectives, each of which has a default of its own."""
OBJECTIVES = ("smooth", "return")
FACTORS = (0.8, 0.7, 0.5)
"""Of all gains, by hand."""
COLUMNS = ("return", "success_percent", "failure_percent", "action_change", "tip_speed", "tip_jerk")
FIRST = (
    *("agent", "kind", "seed", "distance"),
    *("return_difference", "return_difference_low", "return_difference_high"),
)
_NAMES = {
    "return": "return_mean",
    "action_change": "action_change_mean",
    "tip_speed": "tip_speed_mean",
    "tip_jerk": "tip_jerk_mean_square",
}
Row = dict[str, Any]


def drs(*words: object) -> str:
    """What a command prints on standard output."""
    command = [sys.executable, "-m", "drs_core.cli", *map(str, words)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


@dataclass(frozen=True)
class Study:
    """What is done with each agent.

    Attributes:
        runs: where all is kept.
        seeds: searches of each objective.
        draws: random moves.
        options: of every command.
        episodes: of each comparison.
        tune: more of `drs tune`.
    """

    runs: Path
    seeds: int
    draws: int
    options: Sequence[str]
    episodes: int
    tune: Sequence[str]

    @property
    def gains(self) -> bool:
        """Whether only the gains of the actions are searched."""
        return "--action-gains" in self.tune

    def folder(self, name: str) -> Path:
        """Where all of an agent is kept."""
        return self.runs / "-".join(Path(name).parts[-2:])

    def rows(self, name: str) -> Iterator[Row]:
        """A row for each search and each random move of an agent; for gains also for some by hand."""
        start, folder, distances = resolve(name), self.folder(name), list[float]()
        for objective in OBJECTIVES:
            for seed in range(self.seeds):
                agent = self.tuned(name, objective, seed, folder / f"{objective}-{seed}")
                distance = distance_to(agent, start)
                if objective == "smooth":
                    distances.append(distance)
                yield self.row(name, objective, seed, distance, agent)
        for factor in FACTORS if self.gains else ():
            agent = folder / f"times-{factor}.safetensors"
            times(start, factor).save(agent)
            yield self.row(name, "times", factor, distance_to(agent, start), agent)
        for draw in range(self.draws):
            agent, distance = folder / f"random-{draw}.safetensors", float(np.mean(distances))
            random_move(start, distance, draw, self.gains).save(agent)
            yield self.row(name, "random", draw, distance, agent)

    def tuned(self, name: str, objective: str, seed: int, run: Path) -> Path:
        """The newest agent of a search, which is run unless it was."""
        schedule = () if self.gains else SCHEDULE
        words = ("--objective", objective, "--seed", seed, "--output", run, *BUDGET, *self.options)
        words += (*schedule, *self.tune)
        drs("tune", name, *words, *(("--resume",) if run.exists() else ()))
        return run / "agent.safetensors"

    def row(self, name: str, kind: str, seed: float, distance: float, after: Path) -> Row:
        """Means of fresh episodes before and after, and the paired difference of the return; kept beside `after`."""
        # by what was compared: another distance or number of episodes is another comparison
        kept = after.with_name(f"{after.stem}-{load(after).digest()[:12]}-{self.episodes}.json")
        if not kept.exists():
            kept.write_text(drs("compare", name, after, "--json", "--episodes", self.episodes, *self.options))
        found = json.loads(kept.read_text())
        difference = found["differences"]["return"]
        row = dict(zip(FIRST, (name, kind, seed, distance, difference["mean"], *difference["ci95"]), strict=True))
        sides = {(column, side): _NAMES.get(column, column) for column in COLUMNS for side in ("before", "after")}
        return row | {f"{column}_{side}": found[side].get(key) for (column, side), key in sides.items()}


def distance_to(agent: Path, start: Agent) -> float:
    """How far theta has come."""
    return float(np.linalg.norm(load(agent).theta.astype(np.float64) - start.theta))


def times(start: Agent, factor: float) -> Agent:
    """The agent with all its actions' gains times a factor."""
    scope = start.network.scope(action_gains=True)
    theta = start.theta.copy()
    theta[scope.start :] = scope.scaled(start.theta, np.full(scope.size(len(theta)), factor, dtype=np.float32))
    return start.with_theta(theta, start.tuning)


def random_move(start: Agent, distance: float, draw: int, action_gains: bool) -> Agent:
    """The agent moved so far in a random direction of its parameters, or of its actions' gains."""
    d, scope = len(start.theta), start.network.scope(action_gains=action_gains)
    direction = np.random.default_rng([draw, 0x5EED]).standard_normal(scope.size(d))
    if action_gains:
        direction = np.concatenate([np.zeros(scope.start), scope.scaled(start.theta.astype(np.float64), direction)])
    theta = start.theta + distance * direction / np.linalg.norm(direction)
    return start.with_theta(theta.astype(np.float32), start.tuning)


def print_rows(rows: Iterable[Row]) -> None:
    """As CSV, each as it comes."""
    sides = [f"{name}_{side}" for name in COLUMNS for side in ("before", "after")]
    writer = csv.DictWriter(sys.stdout, (*FIRST, *sides), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: f"{value:.6g}" if isinstance(value, float) else value for key, value in row.items()})
        sys.stdout.flush()


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("agents", nargs="+")
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--backend", default="python")
    parser.add_argument("--workers", default="0")
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    asked, tune = parser.parse_args(words[:cut]), words[cut + 1 :]
    options = ("--backend", asked.backend, "--workers", asked.workers)
    study = Study(asked.runs, asked.seeds, asked.draws, options, asked.episodes, tune)
    print_rows(row for name in asked.agents for row in study.rows(name))


if __name__ == "__main__":
    main()
