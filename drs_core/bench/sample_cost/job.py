"""One agent, one method, one tuning seed: rollouts until the goal is reached, kept line by line."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drs_core import json_lines
from drs_core.agent import Agent
from drs_core.bench.sample_cost.config import MAX_ROLLOUTS
from drs_core.bench.sample_cost.goal import Goal
from drs_core.bench.sample_cost.looks import EPISODES, FIRST, due, look_seeds
from drs_core.bench.sample_cost.methods import Entry
from drs_core.bench.sample_cost.methods.method import Candidates, Float64, Method
from drs_core.errors import UsageError
from drs_core.files import make_folder
from drs_core.objective import BASELINE_EPISODES, Objective
from drs_core.policy import Float32
from drs_core.rollouts import InProcess, Rollouts, Task
from drs_core.search import baseline_seeds

_COUNTER = "rollouts"


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

    def records(self) -> list[dict[str, Any]]:
        """What is kept: a head, then updates and looks in order.

        Raises:
            UsageError: the file is of another job.
        """
        records = json_lines.read(self.path, _COUNTER)
        if records and records[0] != self._head():
            raise UsageError(f"{self.path} is of another agent, goal, backend or setting; choose another --output.")
        return records

    def _head(self) -> dict[str, Any]:
        head = {
            _COUNTER: 0,
            "agent": self.agent.digest(),
            "goal": asdict(self.goal),
            "settings": dict(self.entry.settings(self.seed)),
            "backend": self.backend,
        }
        # as it will be read: a pair comes back as a list
        return dict(json.loads(json.dumps(head)))

    def said(self) -> str:
        """How far it is, for people."""
        records = self.records()
        # a search that went on further than is asked now counts up to here
        within = [record for record in records if record[_COUNTER] <= self.most]
        done = within[-1][_COUNTER] if within else 0
        if not ended(records, self.most):
            return f"{done} rollouts so far"
        reached = [record[_COUNTER] for record in within if record.get("reached")]
        return f"reached after {reached[0]} rollouts" if reached else f"not reached after {done} rollouts"

    def run(self, until: float | None = None) -> bool:
        """Go on to the end, or to the first update after `until` [s, of time.monotonic]; whether it ended.

        Raises:
            DrsError: the records cannot be written, or an episode failed.
        """
        # a line that was half written goes
        json_lines.cut_back(self.path, MAX_ROLLOUTS, _COUNTER)
        records = self.records()
        if ended(records, self.most):
            return True
        if not records:
            make_folder(self.path.parent)
            json_lines.append(self.path, self._head())
        with closing(InProcess(self.agent, self.backend)) as rollouts:
            method, done, looked = self._replayed(records[1:])
            objective, told = self._objective(rollouts), list[float]()

            def value(candidates: Candidates) -> Float64:
                found = [objective(*rollouts.run(theta, [Task(seed)])) for theta, seed in candidates]
                told.extend(found)
                return np.array(found)

            while until is None or time.monotonic() < until:
                last = done + method.rollouts > self.most
                if due(looked, done) or (last and looked < done):
                    looked, found = done, self._look(rollouts, method.theta, done)
                    json_lines.append(self.path, found)
                    last = last or found["reached"]
                if last:
                    return True
                told.clear()
                method.update(value)
                done += len(told)
                json_lines.append(self.path, {_COUNTER: done, "objectives": told})
        return False

    def _replayed(self, records: Sequence[Mapping[str, Any]]) -> tuple[Method, int, int]:
        """The method after what it was told, and rollouts until then and until the newest look."""
        method, done, looked = self.entry.make(self.seed, self.agent), 0, -1
        for record in records:
            if "objectives" in record:
                method.update(partial(_recall, iter(record["objectives"])))
                done = record[_COUNTER]
            else:
                looked = record[_COUNTER]
        return method, done, looked

    def _objective(self, rollouts: Rollouts) -> Objective:
        objective = Objective(self.goal.objective)
        if not objective.needs_baseline:
            return objective
        seeds = baseline_seeds(self.seed, BASELINE_EPISODES)
        return objective.weighed(rollouts.run(self.agent.theta, [Task(seed) for seed in seeds]))

    def _look(self, rollouts: Rollouts, theta: Float32, done: int) -> dict[str, Any]:
        tasks = [Task(seed, self.goal.measure) for seed in look_seeds(self.seed, done)]
        episodes = rollouts.run(theta, tasks[:FIRST])
        if not self.goal.out_of_reach(episodes):
            episodes += rollouts.run(theta, tasks[FIRST:])
        reached = len(episodes) == EPISODES and self.goal.reached(episodes)
        return {
            _COUNTER: done,
            "reached": reached,
            "shown": self.goal.shown(episodes),
            "returns": [episode.return_ for episode in episodes],
        }


def ended(records: Sequence[Mapping[str, Any]], most: int) -> bool:
    """Whether within `most` rollouts the goal is reached, or all of them are spent and looked at."""
    within = [record for record in records if record[_COUNTER] <= most]
    if any(record.get("reached") for record in within):
        return True
    done = [record[_COUNTER] for record in within if "objectives" in record]
    spent = bool(done) and done[-1] + done[0] > most
    return spent and (len(within) < len(records) or "reached" in within[-1])


def _recall(objectives: Iterator[float], candidates: Candidates) -> Float64:
    # where none is left, the method has valued fewer
    return np.array([objective for _, objective in zip(candidates, objectives)])
