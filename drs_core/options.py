"""Arguments and options that several commands share, and what is checked before any work."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from drs_core.errors import UsageError

AgentName = Annotated[
    str,
    typer.Argument(metavar="AGENT", help="Agent file, shipped name, run folder, SB3 zip, zoo folder or hf:org/name."),
]
Episodes = Annotated[int, typer.Option(help="Episodes to run.")]
Seed = Annotated[int, typer.Option(help="First episode seed; the others follow one by one.")]
Workers = Annotated[int | None, typer.Option(help="Worker processes; 0 runs in this process. [default: all cores]")]
Backend = Annotated[
    str,
    typer.Option(help="What runs episodes: python; plain: as upstream, slower; compiled: PyBullet walkers, faster."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")]


def folder_named(text: str | Path) -> Path:
    """The folder that an option names; an empty name, as of a shell's variable that is not set, would be this one.

    Raises:
        UsageError: it is empty.
    """
    if not str(text).strip():
        raise UsageError("The folder's name is empty; name one, or . for the one that you are in.")
    return Path(text)


def worker_count(asked: int | None) -> int:
    """Workers asked for, or one a core that this process may use, which in a container is less than there are."""
    if asked is not None:
        return asked
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
