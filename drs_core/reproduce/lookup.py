"""Whose agent stands in for a row: the zoo's, or a shipped one of the same environment and algorithm."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from drs_core.agent import Agent, load
from drs_core.agents import shipped
from drs_core.environments import current_name
from drs_core.errors import UsageError
from drs_core.importing import resolve
from drs_core.reproduce.paper import PaperRow


class NoAgentError(UsageError):
    """A row has no agent, which is no mistake of what is there."""


@dataclass(frozen=True, eq=False)
class Baseline:
    """An untuned agent and what to call it."""

    name: str
    agent: Agent


def find(row: PaperRow, zoo: Path | None) -> Baseline:
    """The row's agent: in the zoo's layout ``a2c/HopperBulletEnv-v0_1`` under `zoo`, or else shipped.

    Raises:
        NoAgentError: there is none.
        UsageError: the zoo's cannot be read.
    """
    for name, get in _candidates(row, zoo):
        agent = get()
        if agent.environment == row.environment and not agent.tuning:
            return Baseline(name, agent)
    where = f"in {zoo} or among" if zoo else "among"
    raise NoAgentError(f"There is no {row.algorithm} agent of {row.environment} {where} the shipped ones.")


def _candidates(row: PaperRow, zoo: Path | None) -> Iterator[tuple[str, Callable[[], Agent]]]:
    if zoo is not None:
        for folder in sorted((zoo / row.algorithm).glob("*_*"), key=_number, reverse=True):
            if current_name(folder.name.rpartition("_")[0]) == row.environment:
                yield f"{row.algorithm}/{folder.name}", lambda folder=folder: resolve(str(folder))  # type: ignore[misc]
    for name, path in shipped().items():
        agent = load(path)
        if agent.source.get("algorithm") == row.algorithm:
            yield name, lambda agent=agent: agent  # type: ignore[misc]


def _number(folder: Path) -> int:
    """The zoo numbers its trainings; the newest counts."""
    number = folder.name.rpartition("_")[2]
    return int(number) if number.isdecimal() else -1
