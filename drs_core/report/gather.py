"""Before and after on the same seeds: evaluated, and some episodes recorded to be shown."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent, load
from drs_core.environments.environment import Environment
from drs_core.environments.robot_state import period_s
from drs_core.episode import ACTIONS, MOTION, TRAJECTORY, Episode
from drs_core.errors import UsageError
from drs_core.evaluation import Evaluation, comparison, evaluate, summary, typical_seed
from drs_core.importing import resolve
from drs_core.report.run import Record, Run
from drs_core.rollouts import Progress, local
from drs_core.rollouts.task import Task
from drs_core.run_folder import BEFORE, updates_done

QUANTILES = (0.5, 0.75, 0.95)
"""Episodes to show, by their place among all before: the median one first."""
_SHOWN_S = 8.0
_FEWEST_RANKED = 20
"""Among fewer episodes there is no place at 95 %, and the median one is shown alone."""

NEWEST, BEST = "newest", "best"

Bar = Callable[[str, int], AbstractContextManager[Progress]]
"""A progress bar with a label and a number of steps."""


@dataclass(frozen=True)
class Side:
    """An agent, before or after: all episodes, their summary, and recorded ones of the shown seeds."""

    label: str
    agent: Agent
    evaluation: Evaluation
    summary: dict[str, Any]
    shown: list[Episode]


@dataclass(frozen=True)
class Findings:
    """All that the page tells.

    Attributes:
        run: the run.
        done: updates that the agent shown has had.
        file: its name in the folder.
        before, after: the two sides; no after where no update was done yet.
        compared: the paired comparison.
        step_s: simulated time of a step [s].
        time_limit_steps: an episode's greatest length.
        goal: (3,) where the tip, or the object, is to be in the first episode shown [m]; Panda only.
    """

    run: Run
    done: int
    file: str
    before: Side
    after: Side | None
    compared: dict[str, Any] | None
    step_s: float
    time_limit_steps: int
    goal: NDArray[np.float64] | None

    @property
    def sides(self) -> list[Side]:
        """One or two."""
        return [self.before, self.after] if self.after else [self.before]

    @property
    def history(self) -> list[Record]:
        """Of the updates that the agent shown has had."""
        return [record for record in self.run.history if record["update"] <= self.done]


def start_agent(run: Run, name: str | None) -> Agent:
    """The agent that the run began with, found by its name or at another place.

    Raises:
        UsageError: it is not there, or it is another one.
    """
    try:
        agent = resolve(name or run.name)
    except UsageError as error:
        if name:
            raise
        raise UsageError(
            f"The run began with {run.name!r}: {error} Say where it is now with --before AGENT."
        ) from error
    if agent.digest() != run.digest:
        raise UsageError(
            f"{name or run.name!r} is not the agent that the run began with (digest {agent.digest()[:16]}, "
            f"not {run.digest[:16]}); say where that one is with --before AGENT."
        )
    return agent


@dataclass(frozen=True)
class Tuned:
    """An agent that a run made, after how many updates, and the name of its file."""

    agent: Agent
    done: int
    file: str


def tuned_agent(run: Run, start: Agent, which: str) -> Tuned | None:
    """``newest``, ``best`` or a file; None where no update was done yet.

    Raises:
        UsageError: it is not there, or not of this run.
    """
    path = {NEWEST: run.folder.agent, BEST: run.folder.best}.get(which, Path(which))
    if which == NEWEST and not path.exists():
        return None
    agent = load(path)
    record = {**BEFORE, **agent.tuning[-1]} if agent.tuning else {}
    # through JSON, as the record went: pairs are lists there
    config = json.loads(json.dumps(run.config.flat() | {"smoothness_weight": run.weight}))
    same = (agent.environment, agent.network) == (start.environment, start.network)
    if not same or any(record.get(key) != value for key, value in config.items()):
        raise UsageError(f"{path} was not made by the run in {run.folder.path}; choose newest, best or a file of it.")
    done = updates_done(agent)
    return Tuned(agent, done, path.name) if done else None


def gather(run: Run, before: Agent, after: Tuned | None, episodes: int, seed: int, workers: int, bar: Bar) -> Findings:
    """Run the episodes, on the backend of the run."""
    with closing(Environment(run.environment)) as environment:
        step_s, limit = period_s(environment), environment.spaces.time_limit_steps
    most = max(1, min(len(QUANTILES), round(_SHOWN_S / (limit * step_s)))) if episodes >= _FEWEST_RANKED else 1
    sides: list[Side] = []
    seeds: list[int] = []
    for label, agent in [("before", before), *([("after", after.agent)] if after else [])]:
        pool = local(agent, min(workers, episodes), run.config.backend)
        with closing(pool), bar(f"episodes {label}", episodes) as progress:
            found = evaluate(label, agent, pool, episodes, seed, progress)
            seeds = seeds or list(dict.fromkeys(typical_seed(found, quantile) for quantile in QUANTILES[:most]))
            tasks = [Task(shown, frozenset({TRAJECTORY, MOTION, ACTIONS})) for shown in seeds]
            sides.append(Side(label, agent, found, summary(found), pool.run(agent.theta, tasks)))
    return Findings(
        run=run,
        done=after.done if after else 0,
        file=after.file if after else run.folder.agent.name,
        before=sides[0],
        after=sides[1] if after else None,
        compared=comparison(sides[0].evaluation, sides[1].evaluation) if after else None,
        step_s=step_s,
        time_limit_steps=limit,
        goal=_goal(run.environment, seeds[0]),
    )


def _goal(environment_id: str, seed: int) -> NDArray[np.float64] | None:
    if not environment_id.startswith("Panda"):
        return None
    with closing(Environment(environment_id)) as environment:
        observation = environment.reset(seed)
    return np.asarray(observation["desired_goal"][:3], dtype=np.float64) if isinstance(observation, dict) else None
