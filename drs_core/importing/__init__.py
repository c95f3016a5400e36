"""Any agent, by the name that a person would give it -> Agent."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path

from drs_core.agent import SUFFIX, Agent, load
from drs_core.agents import shipped
from drs_core.errors import UsageError
from drs_core.importing.hub import PREFIX, fetch
from drs_core.importing.stable_baselines import Hints, import_saved

__all__ = ["Hints", "import_agent", "resolve"]

_OF_IMPORT = re.compile(r"--(env|algo|vecnormalize|time-feature)\b")


def import_agent(source: str, hints: Hints | None = None) -> Agent:
    """Import a Stable-Baselines3 zip, a zoo folder or a hub id (``hf:org/name``).

    Raises:
        UsageError: what is there cannot be imported; the message says what and why.
        DrsError: the hub does not answer.
    """
    ready = _ready(source)
    if ready is not None and (not os.path.isdir(source) or _run_folders_agent(source) == ready):
        raise UsageError(f"{source} needs no import; use it as it is: drs evaluate {source}")
    path = fetch(source) if source.startswith(PREFIX) else Path(source)
    return import_saved(path, hints or Hints())


def resolve(name: str) -> Agent:
    """An agent by file, shipped name, run folder (its newest agent), or anything that can be imported.

    Raises:
        UsageError: there is none of that name.
    """
    ready = _ready(name)
    if ready is not None:
        return load(ready)
    try:
        return import_agent(name)
    except UsageError as error:
        if not _OF_IMPORT.search(str(error)):
            raise
        command = f"{shlex.join(['drs', 'import', name])} -o FILE{SUFFIX}"
        raise UsageError(f"{error} Import it first, with that option: {command}") from error


def _ready(name: str) -> Path | None:
    """The agent file that a name stands for; None for what has to be imported.

    A shipped agent's name stays its own, whatever folders are called: runs know the agent that they began with by it.
    """
    if name in shipped():
        return shipped()[name]
    return _run_folders_agent(name) or (Path(name) if name.endswith(SUFFIX) else None)


def _run_folders_agent(name: str) -> Path | None:
    """The newest agent of a run folder; None where the name is of none.

    Raises:
        UsageError: no update of it is done yet.
    """
    newest = Path(name) / f"agent{SUFFIX}"
    # unlike Path's, these never raise
    if not os.path.isfile(newest.parent / "run.json") or any(newest.parent.glob("*.zip")):
        return None
    if not os.path.isfile(newest):
        raise UsageError(f"No update is done yet in the run folder {name}; wait for the first, or give a file.")
    return newest
