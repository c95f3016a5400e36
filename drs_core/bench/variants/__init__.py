"""What is compared, each in a file of its own behind one protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol, cast

from drs_core.accelerator import COMPILED, PYTHON
from drs_core.agent import Agent
from drs_core.bench.sample import Sample
from drs_core.errors import DrsError, UsageError, install

WORKERS = (1, 2)
BACKENDS = (PYTHON, COMPILED)
"""Of this project's rollouts in this process; plain stepping is left out."""


class Absent(DrsError):
    """A variant cannot run here or in this environment; the message says why."""


class Variant(Protocol):
    """One way to run an agent's episodes."""

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again until at least `steps` environment steps."""
        ...

    def close(self) -> None:
        """Free simulators and processes."""
        ...


@dataclass(frozen=True)
class Entry:
    """How a variant is called in tables, and how it is made."""

    title: str
    make: Callable[[Agent], Variant]


def variants() -> dict[str, Entry]:
    """Every variant by name, in the order of tables; a backend of this project is one more."""
    ours = {
        name: Entry("drs, in-process" if name == PYTHON else f"drs, {name}", _later("ours", "in_process", name))
        for name in BACKENDS
    }
    pools = {
        f"workers_{count}": Entry(f"drs, {count} worker{'s' * (count > 1)}", _later("ours", "pool", count))
        for count in WORKERS
    }
    return {
        "authors": Entry("SB3 predict, VecEnv", _later("authors", "Authors")),
        "ars": Entry("sb3_contrib ARS", _later("ars", "Ars")),
        "evotorch": Entry("EvoTorch GymNE", _later("gymne", "GymNe")),
        **ours,
        **pools,
        "ros": Entry("drs, 2 ROS 2 nodes", _later("ros", "OverRos", 2)),
        "physics": Entry("physics alone", _later("physics", "Physics")),
    }


def pairs() -> list[tuple[str, str]]:
    """(over, under) of the ratios of CPU time that are worth telling."""
    peers = ("authors", "ars", "evotorch")
    return [(peer, name) for peer in peers for name in BACKENDS] + [(name, "physics") for name in BACKENDS]


def chosen(wanted: tuple[str, ...]) -> dict[str, Entry]:
    """The variants of these names, all for none.

    Raises:
        UsageError: one of them is unknown.
    """
    known = variants()
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise UsageError(f"There is no variant {unknown[0]!r}; choose some of {', '.join(known)}.")
    return {name: entry for name, entry in known.items() if not wanted or name in wanted}


def _later(module: str, name: str, *arguments: object) -> Callable[[Agent], Variant]:
    """A maker whose module is imported when it is first used: a peer that is not installed is only absent."""

    def make(agent: Agent) -> Variant:
        try:
            maker = getattr(import_module(f"{__name__}.{module}"), name)
        except ModuleNotFoundError as error:
            needed = (error.name or "").partition(".")[0]
            raise Absent(f"it needs {needed}; {install('peers')}") from error
        return cast(Variant, maker(agent, *arguments))

    return make
