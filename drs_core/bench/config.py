"""What a benchmark runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drs_core.environments import PAPER, current_name
from drs_core.errors import UsageError

MAX_ROUNDS = 1000
MAX_STEPS = 10_000_000


@dataclass(frozen=True)
class BenchConfig:
    """Settings of a benchmark.

    Attributes:
        environments: ids of the paper's environments.
        variants: names to measure; empty for all.
        rounds: how often every variant has its turn.
        steps: environment steps of a turn, rounded up to whole episodes; None for as many as this
            project takes in `turn_s`.
        turn_s: CPU time of a turn of this project in-process [s], where steps is None.
        agents: folder of the rl-zoo with agents to use; others are the shipped ones or random.
        updates: measure whole updates too.
    """

    environments: tuple[str, ...] = tuple(PAPER)
    variants: tuple[str, ...] = ()
    rounds: int = 7
    steps: int | None = None
    turn_s: float = 0.25
    agents: Path | None = None
    updates: bool = True

    def __post_init__(self) -> None:
        """Raise UsageError with the value and what is allowed."""
        if not 1 <= self.rounds <= MAX_ROUNDS:
            raise UsageError(f"rounds is {self.rounds}; allowed are 1 to {MAX_ROUNDS}.")
        if self.steps is not None and not 1 <= self.steps <= MAX_STEPS:
            raise UsageError(f"steps is {self.steps}; allowed are 1 to {MAX_STEPS}.")
        unknown = [name for name in self.environments if name not in PAPER]
        if unknown or not self.environments:
            raise UsageError(f"No environment of the paper is called {unknown}; they are {', '.join(PAPER)}.")
        if self.agents is not None and not self.agents.is_dir():
            raise UsageError(f"There is no folder {self.agents}; check --agents.")


def names(text: str | None) -> tuple[str, ...]:
    """``a,b`` -> (a, b), each once."""
    return tuple(dict.fromkeys(word.strip() for word in (text or "").split(",") if word.strip()))


def environment_ids(text: str | None) -> tuple[str, ...]:
    """Ids from a list such as ``Hopper,PandaReach-v3``: an id, an old id, or how one of the paper's begins.

    Raises:
        UsageError: a word is none of these, or the beginning of several.
    """
    ids = []
    for word in names(text):
        name = current_name(word)
        found = [name] if name in PAPER else [known for known in PAPER if known.startswith(word)]
        if len(found) > 1:
            # BipedalWalker is the beginning of BipedalWalkerHardcore too
            found = [known for known in found if known.startswith(f"{word}-")] or found
        if len(found) != 1:
            meant = f"could be {', '.join(found)}" if found else f"is none of {', '.join(PAPER)}"
            raise UsageError(f"Environment {word!r} {meant}.")
        ids += found
    return tuple(dict.fromkeys(ids)) or tuple(PAPER)
