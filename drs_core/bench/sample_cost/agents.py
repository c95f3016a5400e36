"""The agents whose cost is measured, and what each is to reach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drs_core.accelerator import choose
from drs_core.agent import Agent
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.goal import Goal, Return, Smooth
from drs_core.errors import UsageError
from drs_core.reproduce.lookup import find
from drs_core.reproduce.paper import RETURN, PaperRow, paper_rows
from drs_core.reproduce.selection import fits, names
from drs_core.rollouts import InProcess, Task
from drs_core.search import baseline_seeds

SMOOTH = "PandaReach-tqc"
"""Of table IV; the paper's own value there is reached by moving less, so the arm's steadiness is asked for."""
BASELINE_EPISODES = 100


@dataclass(frozen=True, eq=False)
class Subject:
    """An agent, what is asked of it, and what runs its episodes."""

    name: str
    agent: Agent
    goal: Goal
    backend: str


def subjects(config: SampleCostConfig) -> tuple[list[Subject], list[str]]:
    """Every row with an agent, and the names of the rows without one.

    Raises:
        UsageError: no row is asked for by such a word, or none has an agent.
    """
    rows = [*paper_rows("I"), *(row for row in paper_rows("IV") if row.name == SMOOTH)]
    asked = _select(rows, config.rows)
    found, missing = [], []
    for row in asked:
        try:
            agent = find(row, config.agents).agent
        except UsageError:
            missing.append(row.name)
            continue
        backend = choose(config.backend, agent)
        found.append(Subject(row.name, agent, _goal(row, agent, backend), backend))
    if not found:
        raise UsageError("None of these rows has an agent; give --agents a folder of the rl-zoo.")
    return found, missing


def _select(rows: Sequence[PaperRow], asked: str | None) -> list[PaperRow]:
    words = [word.strip() for word in (asked or "*").split(",") if word.strip()]
    for word in words:
        if not any(fits(row, word) for row in rows):
            raise UsageError(f"No row is called {word[:80]!r}; there are {names(rows)}.")
    return [row for row in rows if any(fits(row, word) for word in words)]


def _goal(row: PaperRow, agent: Agent, backend: str) -> Goal:
    if row.name != SMOOTH:
        return Return(row.printed[RETURN][1].mean)
    rollouts = InProcess(agent, backend)
    try:
        tasks = [Task(seed, Smooth.measure) for seed in baseline_seeds(0, BASELINE_EPISODES)]
        return Smooth.of(rollouts.run(agent.theta, tasks))
    finally:
        rollouts.close()
