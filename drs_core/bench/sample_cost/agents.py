"""The agents whose cost is measured, and what each is to reach."""

from __future__ import annotations

from dataclasses import dataclass

from drs_core.accelerator import choose
from drs_core.agent import Agent
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.goal import Goal, Return, Smooth
from drs_core.errors import UsageError, shown
from drs_core.reproduce.lookup import NoAgentError, find
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
        UsageError: no row is asked for by such a word, none has an agent, or one cannot be read.
    """
    asked = _select(config.rows)
    found, missing = [], []
    for row in asked:
        try:
            agent = find(row, config.agents).agent
        except NoAgentError:
            # one that cannot be read ends the command instead: rows are compared, and hours would go by without it
            missing.append(row.name)
            continue
        backend = choose(config.backend, agent)
        found.append(Subject(row.name, agent, _goal(row, agent, backend), backend))
    if not found:
        raise UsageError("None of these rows has an agent; give --agents a folder of the rl-zoo.")
    return found, missing


def _select(asked: str | None) -> list[PaperRow]:
    table = paper_rows("I")
    rows = [*table, *(row for row in paper_rows("IV") if row.name == SMOOTH)]
    if asked is None:
        return rows
    there = f"there are 1 to {len(table)}: {names(rows)}"
    words = [word.strip() for word in asked.split(",") if word.strip()]
    if not words:
        raise UsageError(f"--rows {shown(asked)} names no row; {there}.")
    for word in words:
        if not any(_fits(row, word) for row in rows):
            raise UsageError(f"No row is called {word[:80]!r}; {there}.")
    return [row for row in rows if any(_fits(row, word) for word in words)]


def _fits(row: PaperRow, word: str) -> bool:
    # a number is of table I, and that of another table would be taken for one
    return fits(row, word) and not (word.isdecimal() and row.name == SMOOTH)


def _goal(row: PaperRow, agent: Agent, backend: str) -> Goal:
    if row.name != SMOOTH:
        return Return(row.printed[RETURN][1].mean)
    rollouts = InProcess(agent, backend)
    try:
        tasks = [Task(seed, Smooth.measure) for seed in baseline_seeds(0, BASELINE_EPISODES)]
        return Smooth.of(rollouts.run(agent.theta, tasks))
    finally:
        rollouts.close()
