"""The tuning loop, written once: ask -> rollouts -> tell -> record; resumable bit for bit."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drs_core import backing_off, json_lines, observed, stopping
from drs_core.agent import Agent, load
from drs_core.curves import Curves, tensorboard_modules
from drs_core.episode import Episode
from drs_core.objective import BASELINE_EPISODES
from drs_core.plan import Attendant, Nobody, Plan
from drs_core.rollouts import Attempted, Progress, Rollouts, Task, check_enough, run_groups
from drs_core.run_folder import RunFolder
from drs_core.search import SearchConfig, ask, baseline_seeds, evaluation_seeds, tell
from drs_core.sigma_cap import ActionChange, Capped, capped_sigma
from drs_core.tune_config import TuneConfig
from drs_core.versions import installed

Record = dict[str, Any]


MOST_OBJECTIVES_KEPT = 1000
"""Of one evaluation, episode by episode: enough to pair, and a record stays small."""


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
        observe: observed.Observe | None = None,
        stop_when_flat: bool = False,
        tell: Callable[[str], object] | None = None,
    ) -> None:
        """Begin the run in the folder `path`, or with `resume` continue the one that is there.

        `observe` gives what the cap of the action change is judged on, (n, n_features) float32, to a run
        that keeps none yet; without it episodes of `start` do.
        With `stop_when_flat` it ends where `stopping.flat` says so. That changes no update, so it is no
        part of the configuration, and a run that it has ended goes on without it.
        `tell` gets a sentence where other versions of packages have made a part of the run.

        Raises:
            UsageError: a run is there and `resume` is not set, or it is of another agent or configuration,
                or gives `stop_when_flat` too little to go by.
            DrsError: the folder cannot be written.
        """
        if stop_when_flat:
            stopping.RULE.check(config.search.updates, config.evaluate_every, config.evaluation_episodes)
        self.config, self._folder, self._stop_when_flat = config, RunFolder(path), stop_when_flat
        self._tell = tell
        self._versions_known = False
        self.flat: stopping.Flat | None = None
        """Why the newest `run` ended before its last update; None where it did not."""
        # before anything is touched
        tensorboard_modules()
        rows = observed.given(self._folder, observe, config.action_change_max, resume)
        given = None if rows is None else observed.packed(rows, observed.RECORDING_SOURCE)
        self._lock = self._begun(start, name, resume, given)
        self._start, self._start_tuning = start, start.tuning
        self._attendant: Attendant = Nobody()
        self._action_change: ActionChange | None = None
        self.agent, self.done = self._folder.latest(start, config.search.updates)
        self._scope = start.network.scope(config.search.last_layer, config.search.action_gains)
        self._best = self._folder.best_score()
        self._newest_evaluation = self._folder.newest_evaluation()
        self._backed_off = 0
        if config.back_off:
            updates, evaluations = json_lines.read(self._folder.history), json_lines.read(self._folder.evaluations)
            backing_off.check_records(updates, evaluations, self.done, config.evaluate_every)
            self._backed_off = backing_off.times(updates)
        self._judged: int | None = None
        self.objective = config.objective
        """What is maximised; its weight may come with the first `run`."""
        weight = self._folder.baseline_weight()
        if self.objective.needs_baseline and weight is not None:
            self.objective = replace(self.objective, smoothness_weight=weight)

    def run(
        self,
        rollouts: Rollouts,
        observer: Observer,
        stop_after: int | None = None,
        attendant: Attendant | None = None,
    ) -> Agent:
        """Run the remaining updates, at most until `stop_after` are done; returns the newest agent.

        Interrupted at any point it leaves a folder that a later run continues, bit for bit. `attendant`
        is asked before anything moves.

        Raises:
            DrsError: too many episodes could not be finished, or none can be run.
        """
        self._attendant = attendant or Nobody()
        last = self.config.search.updates if stop_after is None else min(stop_after, self.config.search.updates)
        with self._lock, closing(Curves(self._folder.tensorboard, self.done)) as curves:
            if self.config.action_change_max:
                seen = observed.of_run(self._folder, self._start, self.config.search.seed)
                self._action_change = ActionChange(self._start, seen)
            if self.objective.needs_baseline:
                self._weigh(rollouts)
            while self.done < last and not (self._stop_when_flat and self._is_flat(rollouts, observer, curves)):
                self._update(rollouts, observer, curves)
            self._evaluate_alone(rollouts, observer, curves)
        return self.agent

    def _begun(
        self, start: Agent, name: str, resume: bool, observations: tuple[bytes, dict[str, Any]] | None
    ) -> IO[str]:
        """Begin or check the run, and keep others out of it."""
        folder, flat = self._folder, self.config.flat()
        if resume and folder.exists():
            folder.check(start, flat)
            lock = folder.lock()
            if observations is not None:
                folder.keep_observations(*observations)
            return lock
        return folder.begin(start, name, flat, observations)

    @property
    def _search(self) -> SearchConfig:
        """As it is now."""
        return backing_off.more_careful(self.config.search, self._backed_off)

    def _back_off(self, rollouts: Rollouts, observer: Observer, curves: Curves) -> Record:
        """Go on from the best agent where the search is lost; what the record of the coming update says about it."""
        if not self.config.back_off or self.done % self.config.evaluate_every or not self.done:
            return {}
        updates, again = json_lines.read(self._folder.history), dict[str, Any]()
        start = backing_off.start_again(updates)
        if start is None:
            first = json_lines.read(self._folder.evaluations)[0]
            if not backing_off.is_lost(updates, first):
                return {}
            objectives = np.array([self.objective(episode) for episode in self._baseline(rollouts)])
            start = {"objective_mean": float(objectives.mean()), "objective_std": float(objectives.std())}
            again = backing_off.kept(start)
        if not backing_off.is_lost(updates, start):
            return again
        # what the run has at this update is evaluated as ever, and may be the best
        self._evaluate_alone(rollouts, observer, curves)
        self._backed_off += 1
        theta = load(self._folder.best).theta if self._folder.best.exists() else self._start.theta
        self.agent = self._tuned(self.agent, theta)
        return again | {backing_off.KEY: self._backed_off}

    def _plan(self, update: int | None, **more: Any) -> Plan:
        return Plan(self._start.environment, update, self.config.search.updates, **more)

    def _attempted(
        self, rollouts: Rollouts, agent: Agent, groups: list[list[Task]], progress: Progress | None = None
    ) -> list[Attempted]:
        attempts, tell_of = self.config.attempts, self._attendant.on_unfinished
        run = partial(run_groups, rollouts, agent.theta, groups, attempts, progress, tell_of)
        if self._versions_known:
            return run()
        # other versions are told of before they make anything, and kept once they have
        now = installed()
        sentence = self._folder.told_of(now)
        if sentence and self._tell:
            self._tell(sentence)
        found = run()
        self._folder.goes_on_with(now, self.done)
        self._versions_known = True
        return found

    def _baseline(self, rollouts: Rollouts) -> list[Episode]:
        """Episodes of the agent that the run begins with, on seeds apart from all others."""
        seeds = baseline_seeds(self.config.search.seed, BASELINE_EPISODES)
        self._attendant.before(self._plan(None, baseline=len(seeds)))
        groups = [[Task(seed, self.objective.measures)] for seed in seeds]
        found = self._attempted(rollouts, self._start, groups)
        check_enough(found, "episodes of the baseline")
        return [group.episodes[0] for group in found if group.finished]

    def _weigh(self, rollouts: Rollouts) -> None:
        """Take the objective's weight from the agent that the run begins with, and keep it."""
        episodes = self._baseline(rollouts)
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

    def _capped(self, update: int) -> Capped | None:
        """Sigma of an update and what it changes, where there is a cap."""
        if self._action_change is None:
            return None
        perturbations = [perturbation for perturbation, _ in ask(self._search, update, self._scope)]
        change = self._action_change.around(self.agent.theta)
        return capped_sigma(change, perturbations, self.config.action_change_max)

    def _is_flat(self, rollouts: Rollouts, observer: Observer, curves: Curves) -> bool:
        # alone: rollouts beside it would be spent for nothing where the run ends here
        self._evaluate_alone(rollouts, observer, curves)
        if self._judged != self._newest_evaluation:
            self._judged = self._newest_evaluation
            self.flat = stopping.flat(json_lines.read(self._folder.evaluations))
        return self.flat is not None

    def _evaluate_alone(self, rollouts: Rollouts, observer: Observer, curves: Curves) -> None:
        due = self._evaluation_tasks()
        if due:
            self._attendant.before(self._plan(None, evaluations=len(due)))
            self._evaluated(self._attempted(rollouts, self.agent, [[task] for task in due]), observer, curves)

    def _update(self, rollouts: Rollouts, observer: Observer, curves: Curves) -> None:
        backed_off = self._back_off(rollouts, observer, curves)
        search, update, due = self._search, self.done, self._evaluation_tasks()
        n, capped = search.directions, self._capped(update)
        sigma = capped.sigma if capped else search.sigma_at(update)
        change = capped.change if capped else None
        self._attendant.before(self._plan(update + 1, pairs=n, evaluations=len(due), sigma=sigma, change=change))
        start = time.perf_counter()
        measures = self.objective.measures
        asked = [Task(seed, measures, moved) for moved, seed in ask(search, update, self._scope, sigma)]
        # an evaluation of the theta in force runs with the rollouts around it: no worker waits in between
        groups = [asked[i : i + 2] for i in range(0, 2 * n, 2)] + [[task] for task in due]
        total = len(asked) + len(due)
        found = self._attempted(
            rollouts, self.agent, groups, lambda done: observer.on_rollouts(update + 1, done, total)
        )
        rollouts_s = time.perf_counter() - start
        pairs, evaluation = found[:n], found[n:]
        check_enough(pairs, "pairs of rollouts")
        if evaluation:
            self._evaluated(evaluation, observer, curves)
        # of a pair that is dropped neither side counts, whichever was broken off
        objectives = np.array([[self.objective(e) if p.finished else np.nan for e in p.episodes] for p in pairs])
        episodes = [episode for pair in pairs if pair.finished for episode in pair.episodes]
        theta = tell(search, update, self.agent.theta, objectives, self._scope)
        step_norm = float(np.linalg.norm(theta.astype(np.float64) - self.agent.theta))
        self.done += 1
        self.agent = self._tuned(self.agent, theta)
        record = {
            "update": self.done,
            "alpha": search.alpha_at(update),
            "sigma": sigma,
            **_moments(objectives[np.isfinite(objectives)], episodes),
            "step_norm": step_norm,
            "rollouts_per_second": total / rollouts_s,
            "wall_s": time.perf_counter() - start,
            **_broken(pairs),
            **backed_off,
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

    def _evaluated(self, found: Sequence[Attempted], observer: Observer, curves: Curves) -> None:
        check_enough(found, "episodes of an evaluation")
        episodes = [group.episodes[0] for group in found if group.finished]
        missing = len(found) - len(episodes)
        objectives = np.array([self.objective(episode) for episode in episodes])
        record = {"update": self.done, **_moments(objectives, episodes), "episodes": len(episodes)}
        if missing:
            # the hard episodes are the ones that break off: the rest are no match for all
            kept = record | {"unfinished": missing}
        else:
            kept = record | {"objectives": objectives[:MOST_OBJECTIVES_KEPT].tolist()}
            if self._best is None or record["objective_mean"] > self._best:
                self._best = record["objective_mean"]
                self._tuned(self.agent, self.agent.theta, objective_mean=self._best).save(self._folder.best)
        # the record comes last: an evaluation without one is done again
        json_lines.append(self._folder.evaluations, kept)
        self._newest_evaluation = self.done
        curves.add("evaluation", record, self.done)
        observer.on_evaluation(record)

    def _tuned(self, agent: Agent, theta: NDArray[np.float32], **more: float) -> Agent:
        flat = replace(self.config, objective=self.objective).flat()
        record = {**flat, "updates_done": self.done, **more}
        return agent.with_theta(theta, (*self._start_tuning, record))


def _broken(pairs: Sequence[Attempted]) -> Record:
    """How many pairs were run again, and how many dropped; nothing where none was."""
    repeated, dropped = sum(pair.attempts > 1 for pair in pairs), sum(not pair.finished for pair in pairs)
    return {"pairs_repeated": repeated, "pairs_dropped": dropped} if repeated or dropped else {}


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
