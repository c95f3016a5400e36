"""One agent, one method, one tuning seed: rollouts until the goal is reached, kept line by line."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from drs_core.agent import Agent
from drs_core.bench.sample_cost.counting import ended, within
from drs_core.bench.sample_cost.goal import Goal
from drs_core.bench.sample_cost.keeping import add, begin
from drs_core.bench.sample_cost.looks import look
from drs_core.bench.sample_cost.methods import Entry
from drs_core.bench.sample_cost.methods.method import Candidates, Float64, Method
from drs_core.bench.sample_cost.records import COUNTER, Record, read
from drs_core.bench.sample_cost.replay import replay
from drs_core.objective import BASELINE_EPISODES, Objective
from drs_core.rollouts import InProcess, Rollouts, Task
from drs_core.search import baseline_seeds


@dataclass(frozen=True, eq=False)
class Job:
    """What decides a job's result, and where it is kept.

    Attributes:
        agent: where the search begins.
        goal: what is to be reached.
        entry: the method.
        seed: of the search.
        most: rollouts after which it ends.
        backend: what runs the episodes.
        path: of the records.
    """

    agent: Agent
    goal: Goal
    entry: Entry
    seed: int
    most: int
    backend: str
    path: Path

    def records(self) -> list[Record]:
        """What is kept: a head, then updates and looks in order.

        Raises:
            UsageError: the file is of another job, or damaged.
        """
        return read(self.path, self._head())

    def _head(self) -> Record:
        head = {
            COUNTER: 0,
            "agent": self.agent.digest(),
            "goal": asdict(self.goal),
            "settings": dict(self.entry.settings(self.seed)),
            "backend": self.backend,
        }
        # as it will be read: a pair comes back as a list
        return dict(json.loads(json.dumps(head)))

    def check_library(self) -> None:
        """Raise DrsError where something is left to run by a library that is not installed."""
        if not (self.entry.is_ours or ended(self.records(), self.most)):
            self.entry.library()

    def said(self) -> str:
        """How far it is, for people."""
        counts = within(self.records(), self.most)
        if not counts.ended:
            return f"{counts.done} rollouts so far"
        return f"{'' if counts.looks[-1]['reached'] else 'not '}reached after {counts.done} rollouts"

    def run(self, until: float | None = None) -> bool:
        """Go on to the end, or to the first update after `until` [s, of time.monotonic]; whether it ended.

        Raises:
            UsageError: the file is of another job, damaged or a link.
            DrsError: the records cannot be written, or an episode failed.
        """
        records = begin(self.path, self._head())
        if ended(records, self.most):
            return True

        def over() -> bool:
            return until is not None and time.monotonic() >= until

        if over():  # before a replay, which takes long
            return False
        with closing(InProcess(self.agent, self.backend)) as rollouts:
            done = records[-1][COUNTER]
            method = self._replayed(records, done)
            objective, told = self._objective(rollouts), list[float]()

            def value(candidates: Candidates) -> Float64:
                found = [objective(*rollouts.run(theta, [Task(seed)])) for theta, seed in candidates]
                told.extend(found)
                return np.array(found)

            while not (counts := within(records, self.most)).ended:
                if over():
                    return False
                place = counts.missing
                if place is None:
                    told.clear()
                    method.update(value)
                    done += len(told)
                    add(self.path, records, {COUNTER: done, "objectives": list(told)})
                else:
                    # another budget went on beyond it
                    then = method if place == done else self._replayed(records, place)
                    add(self.path, records, look(rollouts, self.goal, then.theta, self.seed, place))
        return True

    def _replayed(self, records: Sequence[Record], until: int) -> Method:
        return replay(self.entry.make(self.seed, self.agent), records, until, self.path)

    def _objective(self, rollouts: Rollouts) -> Objective:
        objective = Objective(self.goal.objective)
        if not objective.needs_baseline:
            return objective
        seeds = baseline_seeds(self.seed, BASELINE_EPISODES)
        return objective.weighed(rollouts.run(self.agent.theta, [Task(seed) for seed in seeds]))
