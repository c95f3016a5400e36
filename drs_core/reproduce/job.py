"""One row on disk: evaluate the baseline, tune it, evaluate what came out; all kept, so all can go on."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from drs_core import json_lines
from drs_core.accelerator import COMPILED, PLAIN, PYTHON, choose
from drs_core.agent import Agent, load
from drs_core.errors import UsageError
from drs_core.files import make_folder
from drs_core.reproduce.config import EVALUATE_EVERY, ReproduceConfig
from drs_core.reproduce.kept import Kept, keep, read
from drs_core.reproduce.lookup import Baseline
from drs_core.reproduce.paper import PaperRow
from drs_core.reproduce.stopping import UNFINISHED, Enough, Stopper, reason, stalled
from drs_core.rollouts import Progress, Rollouts, local
from drs_core.run_folder import RunFolder, updates_done
from drs_core.search import SearchConfig
from drs_core.tuning import Observer, Record, Tuning
from drs_core.versions import Part

BEFORE, AFTER, TUNING = "before", "after", "tuning"


class Watcher(Observer, Protocol):
    """Whoever watches a row."""

    def on_evaluate(self, row: str, stage: str, episodes: int) -> Progress:
        """An evaluation of a row begins; the answer is told how many of its episodes are done."""
        ...

    def on_other_versions(self, sentence: str) -> None:
        """A row's run goes on with other versions of packages than before."""
        ...


@dataclass(frozen=True, eq=False)
class Tuned:
    """The agent that stands for a run.

    Attributes:
        agent: the newest one, or the best by evaluation in the run.
        which: ``newest`` or ``best``.
        update: after which it was.
    """

    agent: Agent
    which: str
    update: int


class Job:
    """One row with its agent and its folder."""

    def __init__(self, row: PaperRow, baseline: Baseline, config: ReproduceConfig) -> None:
        """Look at what is there; nothing is written.

        Raises:
            UsageError: what is there is of another agent, backend or configuration.
        """
        self.row, self.baseline, self._config, self._told = row, baseline, config, set[str]()
        folder = config.output / row.name
        self._run = RunFolder(folder / f"{config.objective}-{config.seed}")
        self._files = {BEFORE: folder / "before.json", AFTER: self._run.path / "after.json"}
        self._digest = baseline.agent.digest()
        before = read(self._files[BEFORE])
        if before and before.digest != self._digest:
            raise UsageError(f"{self._files[BEFORE]} is of another {row.name} agent; give that one or a new --output.")
        self.backend = self._backend_of(before)
        if self._run.exists():
            self._run.check(baseline.agent, config.tuning(self.backend).flat())

    @property
    def path(self) -> Path:
        """The run folder."""
        return self._run.path

    @property
    def settings(self) -> SearchConfig:
        """Of the search."""
        return self._config.tuning(self.backend).search

    def _backend_of(self, before: Kept | None) -> str:
        """What has run this row's episodes, or will."""
        asked = PYTHON if self._config.backend == PLAIN else self._config.backend
        known = {before.backend} if before else set()
        if self._run.exists():
            known.add(str(self._run.setting("backend")))
        if not known:
            return choose(self._config.backend, self.baseline.agent)
        # compiled may have fallen back to python when the row began
        if len(known) > 1 or not known <= {asked, *([PYTHON] if asked == COMPILED else [])}:
            raise UsageError(
                f"{self._files[BEFORE].parent} was begun with --backend {' and '.join(sorted(known))}, not {asked}: "
                "give the same, or a new --output."
            )
        (backend,) = known
        return self._config.backend if backend == asked else backend

    def done(self) -> int:
        """Updates that are kept."""
        return updates_done(load(self._run.agent)) if self._run.agent.exists() else 0

    def history(self) -> list[Record]:
        """A record an update."""
        return json_lines.read(self._run.history)[: self.done()]

    def stop_reason(self) -> str:
        """Why the run ended, or that it has not."""
        schedule, asked = self.settings.updates, self._config
        return reason(self.done(), schedule, asked.updates, self._evaluations(), asked.patience)

    def _evaluations(self) -> list[Record]:
        return json_lines.read(self._run.evaluations)

    def tuned(self) -> Tuned | None:
        """The newest agent where the schedule is complete, or no evaluation has followed the first; else the best."""
        done = self.done()
        if not done:
            return None
        if done < self.settings.updates and len(self._evaluations()) > 1:
            best = load(self._run.best)
            return Tuned(best, "best", updates_done(best))
        return Tuned(load(self._run.agent), "newest", done)

    def evaluated(self, stage: str) -> Kept | None:
        """The kept evaluation of the baseline or of the tuned agent, where it is whole and current."""
        agent = self._agent(stage)
        kept = read(self._files[stage]) if agent else None
        current = kept and agent and (kept.digest, kept.backend) == (agent.digest(), self._kept_backend)
        return kept if kept and current and kept.episodes >= self._config.trials else None

    def made_with(self) -> dict[str, list[Part]]:
        """Which versions made what there is: TUNING, and the episodes that count of BEFORE and AFTER."""
        found = {TUNING: self._run.made_with()} if self.done() else {}
        for stage in (BEFORE, AFTER):
            kept = self.evaluated(stage)
            if kept:
                found[stage] = [part for part in kept.made_with if part.begin < self._config.trials]
        return found

    @property
    def _kept_backend(self) -> str:
        return PYTHON if self.backend == PLAIN else self.backend

    def _agent(self, stage: str) -> Agent | None:
        if stage == BEFORE:
            return self.baseline.agent
        tuned = self.tuned()
        return tuned.agent if tuned else None

    def evaluation_s(self) -> float:
        """Wall time of the baseline's evaluation, where the tuned agent's is still to come."""
        before = self.evaluated(BEFORE)
        return before.wall_s / before.episodes * self._config.trials if before and not self.evaluated(AFTER) else 0.0

    def whole(self) -> bool:
        """Whether nothing is left to do."""
        return self.stop_reason() != UNFINISHED and bool(self.evaluated(BEFORE) and self.evaluated(AFTER))

    def work(self, watcher: Watcher, until: float | None = None) -> None:
        """Go on until the end, or with a time `until` [s, of time.monotonic] at most to the next evaluation."""
        with closing(self._rollouts()) as rollouts:
            self._keep(BEFORE, rollouts, watcher)
            if self.stop_reason() == UNFINISHED:
                self._tune(rollouts, watcher, until)
            if self.stop_reason() != UNFINISHED:
                self._keep(AFTER, rollouts, watcher)

    def conclude(self, watcher: Watcher) -> None:
        """Evaluate what the run has reached, where it has begun."""
        if self.evaluated(BEFORE) and self.tuned() and not self.evaluated(AFTER):
            with closing(self._rollouts()) as rollouts:
                self._keep(AFTER, rollouts, watcher)

    def _rollouts(self) -> Rollouts:
        return local(self.baseline.agent, self._config.workers, self.backend)

    def _keep(self, stage: str, rollouts: Rollouts, watcher: Watcher) -> None:
        agent = self._agent(stage)
        if agent is None or self.evaluated(stage):
            return
        path, trials = self._files[stage], self._config.trials
        make_folder(path.parent)
        progress = watcher.on_evaluate(self.row.name, stage, trials)
        keep(path, agent, self._kept_backend, rollouts, trials, progress)

    def _tune(self, rollouts: Rollouts, watcher: Watcher, until: float | None) -> None:
        done, stop_after = self.done(), self._config.updates
        if until is not None:
            stop_after = min(stop_after, (done // EVALUATE_EVERY + 1) * EVALUATE_EVERY)
        config = self._config.tuning(self.backend)
        start = self.baseline

        def tell(sentence: str) -> None:
            # a row has many turns
            if sentence not in self._told:
                self._told.add(sentence)
                watcher.on_other_versions(sentence)

        tuning = Tuning(start.agent, start.name, config, self._run.path, resume=True, tell=tell)
        stopper = Stopper(
            watcher,
            late=lambda: until is not None and time.monotonic() >= until,
            stalled=lambda: stalled(self._evaluations(), self._config.patience),
        )
        try:
            tuning.run(rollouts, stopper, stop_after)
        except Enough:
            pass
