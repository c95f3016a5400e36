"""The tuning loop, written once: ask -> rollouts -> tell -> record; resumable bit for bit."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drs_core import json_lines, stopping
from drs_core.accelerator import PLAIN, PYTHON, check_backend
from drs_core.agent import Agent
from drs_core.curves import Curves, tensorboard_modules
from drs_core.episode import Episode
from drs_core.errors import UsageError
from drs_core.objective import BASELINE_EPISODES, Objective
from drs_core.rollouts import Rollouts, Task
from drs_core.run_folder import RunFolder
from drs_core.search import SearchConfig, ask, baseline_seeds, evaluation_seeds, tell

Record = dict[str, Any]


@dataclass(frozen=True)
class TuneConfig:
    """Everything that decides a run's result.

    Attributes:
        search: settings of the search.
        objective: what it maximises.
        evaluate_every: updates between evaluations on seeds of their own; 0 for none.
        evaluation_episodes: episodes of one evaluation.
        backend: what runs every episode; `compiled` rounds differently, so a run keeps to it or to the others.
    """

    search: SearchConfig = field(default_factory=SearchConfig)
    objective: Objective = field(default_factory=Objective)
    evaluate_every: int = 10
    evaluation_episodes: int = 20
    backend: str = "python"

    def __post_init__(self) -> None:
        """Raise UsageError with the name, value and range of a setting that is not allowed."""
        for name, least in (("evaluate_every", 0), ("evaluation_episodes", 1)):
            value = getattr(self, name)
            if not least <= value <= 1_000_000:
                raise UsageError(f"{name} is {value}; allowed are {least} to 1000000.")
        check_backend(self.backend)

    def flat(self) -> Record:
        """One mapping of plain values, under the names that parameter files use."""
        return {
            **asdict(self.search),
            "objective": self.objective.name,
            "smoothness_weight": self.objective.smoothness_weight,
            "evaluate_every": self.evaluate_every,
            "evaluation_episodes": self.evaluation_episodes,
            # plain stepping gives the same episodes
            "backend": PYTHON if self.backend == PLAIN else self.backend,
        }


MOST_OBJECTIVES_KEPT = 1000
"""Of one evaluation, episode by episode: enough to pair, and a record stays small."""

SHORT_SCHEDULE: dict[str, tuple[float, float]] = {"alpha": (0.02, 0.01), "sigma": (0.025, 0.0125)}
"""Of `smooth`, unless told otherwise: its runs are short, and to end at a tenth leaves some goals shaking."""


def tune_config(values: Mapping[str, Any]) -> TuneConfig:
    """A configuration from parameters by name, as files and options give them; the others have defaults.

    Raises:
        UsageError: a value is out of range.
    """
    # to ROS a parameter that is not set is 0, so 0 means the same here
    objective = Objective(values.get("objective", "return"), values.get("smoothness_weight") or None)
    known = (SHORT_SCHEDULE if objective.name == "smooth" else {}) | dict(values)
    search = SearchConfig(**{field.name: known[field.name] for field in fields(SearchConfig) if field.name in known})
    rest = {name: values[name] for name in ("evaluate_every", "evaluation_episodes", "backend") if name in values}
    return TuneConfig(search, objective, **rest)


class Observer(Protocol):
    """Whoever watches a run."""

    def on_rollouts(self, update: int, done: int, total: int) -> None:
        """`done` of `total` rollouts of an update are done."""
        ...

    def on_update(self, record: Record) -> None:
        """An update is done and kept."""
        ...

    def on_evaluation(self, record: Record) -> None:
        """An evaluation is done and kept."""
        ...


class Tuning:
    """One run: begin or continue it, then call `run`."""

    def __init__(
        self,
        start: Agent,
        name: str,
        config: TuneConfig,
        path: Path,
        resume: bool = False,
        stop_when_flat: bool = False,
    ) -> None:
        """Begin the run in the folder `path`, or with `resume` continue the one that is there.

        With `stop_when_flat` it ends where `stopping.flat` says so. That changes no update, so it is no
        part of the configuration, and a run that it has ended goes on without it.

        Raises:
            UsageError: a run is there and `resume` is not set, or it is of another agent or configuration,
                or gives `stop_when_flat` too little to go by.
            DrsError: the folder cannot be written.
        """
        if stop_when_flat:
            stopping.RULE.check(config.search.updates, config.evaluate_every, config.evaluation_episodes)
        self.config, self._folder, self._stop_when_flat = config, RunFolder(path), stop_when_flat
        self.flat: stopping.Flat | None = None
        """Why the newest `run` ended before its last update; None where it did not."""
        # before anything is touched
        tensorboard_modules()
        if resume and self._folder.exists():
            self._folder.check(start, config.flat())
        else:
            self._folder.create(start, name, config.flat())
        self._lock = self._folder.lock()
        self._start_tuning = start.tuning
        self.agent, self.done = self._folder.latest(start, config.search.updates)
        self._first = self.agent.network.last_layer_start if config.search.last_layer else 0
        self._best = self._folder.best_score()
        self._newest_evaluation = self._folder.newest_evaluation()
        self._judged: int | None = None
        self.objective = config.objective
        """What is maximised; its weight may come with the first `run`."""
        weight = self._folder.baseline_weight()
        if self.objective.needs_baseline and weight is not None:
            self.objective = replace(self.objective, smoothness_weight=weight)

    def run(self, rollouts: Rollouts, observer: Observer, stop_after: int | None = None) -> Agent:
        """Run the remaining updates, at most until `stop_after` are done; returns the newest agent.

        Interrupted at any point it leaves a folder that a later run continues, bit for bit.
        """
        last = self.config.search.updates if stop_after is None else min(stop_after, self.config.search.updates)
        with self._lock, closing(Curves(self._folder.tensorboard, self.done)) as curves:
            if self.objective.needs_baseline:
                self._weigh(rollouts)
            while self.done < last and not (self._stop_when_flat and self._is_flat(rollouts, observer, curves)):
                self._update(rollouts, observer, curves)
            due = self._evaluation_tasks()
            if due:
                self._evaluated(rollouts.run(self.agent.theta, due), observer, curves)
        return self.agent

    def _weigh(self, rollouts: Rollouts) -> None:
        """Take the objective's weight from the agent that the run begins with, and keep it."""
        seeds = baseline_seeds(self.config.search.seed, BASELINE_EPISODES)
        episodes = rollouts.run(self.agent.theta, [Task(seed) for seed in seeds])
        self.objective = self.objective.weighed(episodes)
        returns = np.array([episode.return_ for episode in episodes])
        figures = {
            "episodes": len(episodes),
            "return_mean": float(returns.mean()),
            "return_std": float(returns.std()),
            "action_change_mean": float(np.mean([episode.action_change for episode in episodes])),
            "smoothness_weight": self.objective.smoothness_weight,
        }
        self._folder.keep_baseline(figures)

    def _is_flat(self, rollouts: Rollouts, observer: Observer, curves: Curves) -> bool:
        due = self._evaluation_tasks()
        if due:
            # alone: rollouts beside it would be spent for nothing where the run ends here
            self._evaluated(rollouts.run(self.agent.theta, due), observer, curves)
        if self._judged != self._newest_evaluation:
            self._judged = self._newest_evaluation
            self.flat = stopping.flat(json_lines.read(self._folder.evaluations))
        return self.flat is not None

    def _update(self, rollouts: Rollouts, observer: Observer, curves: Curves) -> None:
        start = time.perf_counter()
        search, update = self.config.search, self.done
        measures = self.objective.measures
        asked = [Task(seed, measures, perturbation) for perturbation, seed in ask(search, update, self._first)]
        # an evaluation of the theta in force runs with the rollouts around it: no worker waits in between
        tasks = asked + self._evaluation_tasks()
        found = rollouts.run(self.agent.theta, tasks, lambda done: observer.on_rollouts(update + 1, done, len(tasks)))
        rollouts_s = time.perf_counter() - start
        episodes, evaluation = found[: len(asked)], found[len(asked) :]
        if evaluation:
            self._evaluated(evaluation, observer, curves)
        objectives = np.array([self.objective(episode) for episode in episodes])
        theta = tell(search, update, self.agent.theta, objectives.reshape(-1, 2), self._first)
        step_norm = float(np.linalg.norm(theta.astype(np.float64) - self.agent.theta))
        self.done += 1
        self.agent = self._tuned(self.agent, theta)
        record = {
            "update": self.done,
            "alpha": search.alpha_at(update),
            "sigma": search.sigma_at(update),
            **_moments(objectives, episodes),
            "step_norm": step_norm,
            "rollouts_per_second": len(tasks) / rollouts_s,
            "wall_s": time.perf_counter() - start,
        }
        json_lines.append(self._folder.history, record)
        self.agent.save(self._folder.agent)
        curves.add("update", record, self.done)
        observer.on_update(record)

    def _evaluation_tasks(self) -> list[Task]:
        """Rollouts that evaluate the newest agent, where that is due and not done."""
        config = self.config
        if not config.evaluate_every or self.done % config.evaluate_every or self.done == self._newest_evaluation:
            return []
        seeds = evaluation_seeds(config.search.seed, config.evaluation_episodes)
        return [Task(seed, self.objective.measures) for seed in seeds]

    def _evaluated(self, episodes: Sequence[Episode], observer: Observer, curves: Curves) -> None:
        objectives = np.array([self.objective(episode) for episode in episodes])
        record = {"update": self.done, **_moments(objectives, episodes), "episodes": len(episodes)}
        if self._best is None or record["objective_mean"] > self._best:
            self._best = record["objective_mean"]
            self._tuned(self.agent, self.agent.theta, objective_mean=self._best).save(self._folder.best)
        # the record comes last: an evaluation without one is done again
        json_lines.append(self._folder.evaluations, record | {"objectives": objectives[:MOST_OBJECTIVES_KEPT].tolist()})
        self._newest_evaluation = self.done
        curves.add("evaluation", record, self.done)
        observer.on_evaluation(record)

    def _tuned(self, agent: Agent, theta: NDArray[np.float32], **more: float) -> Agent:
        flat = replace(self.config, objective=self.objective).flat()
        record = {**flat, "updates_done": self.done, **more}
        return agent.with_theta(theta, (*self._start_tuning, record))


def _moments(objectives: NDArray[np.float64], episodes: Sequence[Episode]) -> Record:
    returns = np.array([episode.return_ for episode in episodes])
    successes = [episode.success for episode in episodes if episode.success is not None]
    return {
        "objective_mean": float(objectives.mean()),
        "objective_std": float(objectives.std()),
        "return_mean": float(returns.mean()),
        "return_std": float(returns.std()),
        "failure_percent": 100.0 * sum(episode.failed for episode in episodes) / len(episodes),
        "success_percent": 100.0 * sum(successes) / len(successes) if successes else None,
    }
