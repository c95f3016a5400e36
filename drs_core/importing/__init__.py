"""Any agent, by the name that a person would give it -> Agent."""

from __future__ import annotations

from pathlib import Path

from drs_core.agent import SUFFIX, Agent, load
from drs_core.agents import shipped
from drs_core.errors import UsageError
from drs_core.importing.hub import PREFIX, fetch
from drs_core.importing.stable_baselines import Hints, import_saved

__all__ = ["Hints", "import_agent", "resolve"]


def import_agent(source: str, hints: Hints | None = None) -> Agent:
    """Import a Stable-Baselines3 zip, a zoo folder or a hub id (``hf:org/name``).

    Raises:
        UsageError: what is there cannot be imported; the message says what and why.
        DrsError: the hub does not answer.
    """
    if _ready(source) is not None and not Path(source).is_dir():
        raise UsageError(f"{source} needs no import; use it as it is: drs evaluate {source}")
    path = fetch(source) if source.startswith(PREFIX) else Path(source)
    return import_saved(path, hints or Hints())


def resolve(name: str) -> Agent:
    """An agent by file, shipped name, or anything that can be imported.

    Raises:
        UsageError: there is none of that name.
    """
    ready = _ready(name)
    return import_agent(name) if ready is None else load(ready)


def _ready(name: str) -> Path | None:
    """The agent file that a name stands for; None for what has to be imported."""
    return shipped().get(name, Path(name) if name.endswith(SUFFIX) else None)
