"""What else might have made an arm smooth: searches of 640 rollouts by other objectives than `smooth`.

    python scripts/smooth_choices.py panda_reach ZOO/tqc/PandaReach-v1_1 --runs runs/choices > rows.csv

Each run is kept, and the same command goes on. `--choices` takes some of them.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from smooth_motion import Study, distance_to, print_rows

from drs_core.agent import Agent
from drs_core.episode import ACTIONS, DIMENSION, SEEN, Episode
from drs_core.importing import resolve
from drs_core.measures.mesh_dimension import measure_dimension
from drs_core.objective import BASELINE_EPISODES, KAPPA, Objective, per_dimension, smoothness_weight
from drs_core.reporting.progress import TuningProgress
from drs_core.rollouts import InProcess, Task
from drs_core.search import SearchConfig, baseline_seeds
from drs_core.tune_config import SHORT_SCHEDULE, TuneConfig
from drs_core.tuning import Tuning

Value = Callable[[Episode], float]


@dataclass(frozen=True)
class Baseline:
    """The agent that a search begins with.

    Attributes:
        agent: itself.
        episodes: BASELINE_EPISODES of it, with all that any choice measures.
        again: its return on a seed, for a further rollout.
    """

    agent: Agent
    episodes: list[Episode]
    again: Callable[[int], float]

    @property
    def sd(self) -> float:
        """Standard deviation of R."""
        return statistics.pstdev(episode.return_ for episode in self.episodes)

    def mean(self, value: Value) -> float:
        """Of its episodes."""
        return statistics.fmean(map(value, self.episodes))


Make = Callable[[Baseline], Value]


def change(episode: Episode) -> float:
    """A, the mean action change, which is what `smooth` takes."""
    return episode.action_change


def _changes(episode: Episode) -> NDArray[np.float64]:
    if episode.actions is None:
        raise ValueError("run without its actions")
    return np.diff(episode.actions.astype(np.float64), axis=0)


def square(episode: Episode) -> float:
    """Mean squared action change."""
    return float(np.mean(_changes(episode) ** 2))


def root(episode: Episode) -> float:
    """Of the mean squared action change."""
    return math.sqrt(square(episode))


def late(episode: Episode) -> float:
    """A of the second half, in which an arm stays at its goal."""
    changes = _changes(episode)
    return float(np.mean(np.abs(changes[len(changes) // 2 :])))


def whole(episode: Episode) -> float:
    """D, the mesh dimension of an episode."""
    if episode.dimension is None:
        raise ValueError("run without measuring its dimension")
    return episode.dimension.clipped_mean()


def moving(agent: Agent) -> Value:
    """D of the first half, in which an arm moves to its goal."""

    def value(episode: Episode) -> float:
        if episode.seen is None:
            raise ValueError("run without what it saw")
        rows = episode.seen[: episode.length // 2, agent.pipeline.main]
        return measure_dimension(rows).clipped_mean()

    return value


def weighed(measure: Value, kappa: float) -> Make:
    """R - kappa sd measure / (the baseline's mean of it)."""

    def make(baseline: Baseline) -> Value:
        returns, measures = zip(*((e.return_, measure(e)) for e in baseline.episodes), strict=True)
        c = kappa / KAPPA * smoothness_weight(returns, measures)
        return lambda episode: episode.return_ - c * measure(episode)

    return make


def logarithm(kappa: float) -> Make:
    """R - kappa sd log A: each halving of A is worth the same."""
    return lambda baseline: lambda episode: episode.return_ - kappa * baseline.sd * math.log(max(change(episode), 1e-9))


def rated(dimension: Callable[[Baseline], Value]) -> Make:
    """R / D or R * D by some dimension."""

    def make(baseline: Baseline) -> Value:
        measure = dimension(baseline)
        return lambda episode: per_dimension(episode.return_, measure(episode))

    return make


def floor(baseline: Baseline) -> Value:
    """D, but no less than the baseline's: to move less is worth nothing."""
    least = baseline.mean(whole)
    return lambda episode: max(whole(episode), least)


def kept(baseline: Baseline) -> Value:
    """Less A, in units of R, and no less R than the baseline has on the same seed: only what is lost counts."""
    c = baseline.sd / baseline.mean(change)
    return lambda episode: -c * change(episode) - max(baseline.again(episode.seed) - episode.return_, 0.0)


CHOICES: dict[str, tuple[Make, frozenset[str], int]] = {
    "R-3sd*A": (weighed(change, 3.0), frozenset(), 20),
    "R-1.5sd*A": (weighed(change, 1.5), frozenset(), 20),
    "R-1.5sd*log(A)": (logarithm(1.5), frozenset(), 20),
    "R-3sd*square": (weighed(square, 3.0), frozenset({ACTIONS}), 20),
    "R-3sd*root": (weighed(root, 3.0), frozenset({ACTIONS}), 20),
    "R-3sd*late(A)": (weighed(late, 3.0), frozenset({ACTIONS}), 20),
    "R*D": (lambda _: Objective("dimension"), frozenset({DIMENSION}), 20),
    "R*max(D,D0)": (rated(floor), frozenset({DIMENSION}), 20),
    "R*D_moving": (rated(lambda baseline: moving(baseline.agent)), frozenset({SEEN}), 20),
    # a third rollout for each direction
    "least_A,R>=R0": (kept, frozenset(), 14),
}
"""How an episode is valued, what is measured for it, and how many updates 640 rollouts allow."""


@dataclass(frozen=True)
class Choice(Objective):
    """One of them, as an objective of a search."""

    value: Value | None = None
    asks: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        """Take any name."""

    @property
    def needs_baseline(self) -> bool:
        """It has seen it."""
        return False

    @property
    def measures(self) -> frozenset[str]:
        """What a rollout has to measure for it."""
        return self.asks

    def __call__(self, episode: Episode) -> float:
        """The value of one episode."""
        if self.value is None:
            raise ValueError("no value")
        return self.value(episode)


@dataclass(frozen=True)
class Choices:
    """What is done with each agent.

    Attributes:
        study: compares, and keeps.
        names: keys of CHOICES.
    """

    study: Study
    names: list[str]

    def rows(self, name: str) -> Iterator[dict[str, object]]:
        """A row for each choice and seed."""
        start, folder = resolve(name), self.study.folder(name)
        with closing(InProcess(start)) as own:
            for choice in self.names:
                for seed in range(self.study.seeds):
                    run = folder / f"{choice}-{seed}"
                    self._search(start, name, own, choice, seed, run)
                    agent = run / "agent.safetensors"
                    yield self.study.row(name, choice, seed, distance_to(agent, start), agent)

    def _search(self, start: Agent, name: str, own: InProcess, choice: str, seed: int, run: Path) -> None:
        make, asks, updates = CHOICES[choice]

        @cache
        def again(episode_seed: int) -> float:
            return own.run(start.theta, [Task(episode_seed)])[0].return_

        everything = frozenset({ACTIONS, DIMENSION, SEEN})
        episodes = own.run(start.theta, [Task(s, everything) for s in baseline_seeds(seed, BASELINE_EPISODES)])
        value = make(Baseline(start, episodes, again))
        config = TuneConfig(
            SearchConfig(updates, 16, SHORT_SCHEDULE["alpha"], SHORT_SCHEDULE["sigma"], seed),
            Choice(choice, value=value, asks=asks),
            evaluate_every=0,
        )
        console = Console(stderr=True)
        console.print(f"{name}, {choice}, seed {seed}", highlight=False)
        with closing(InProcess(start)) as rollouts, TuningProgress(console, updates) as progress:
            Tuning(start, name, config, run, resume=run.exists()).run(rollouts, progress)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("agents", nargs="+")
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--choices", nargs="+", choices=CHOICES, default=list(CHOICES))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=100)
    asked = parser.parse_args()
    study = Study(asked.runs, asked.seeds, 0, ("--backend", "python", "--workers", "0"), asked.episodes, ())
    choices = Choices(study, asked.choices)
    print_rows(row for name in asked.agents for row in choices.rows(name))


if __name__ == "__main__":
    main()
