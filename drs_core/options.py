"""Arguments and options that several commands share, and what is checked before any work."""

from __future__ import annotations

import os
from typing import Annotated

import typer

AgentName = Annotated[
    str, typer.Argument(metavar="AGENT", help="Agent file, shipped name, SB3 zip, zoo folder or hf:org/name.")
]
Episodes = Annotated[int, typer.Option(help="Episodes to run.")]
Seed = Annotated[int, typer.Option(help="First episode seed; the others follow one by one.")]
Workers = Annotated[int | None, typer.Option(help="Worker processes; 0 runs in this process. [default: all cores]")]
Backend = Annotated[
    str,
    typer.Option(help="What runs episodes: python; plain: as upstream, slower; compiled: PyBullet walkers, faster."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")]


def worker_count(asked: int | None) -> int:
    """The workers asked for, or one for each core."""
    if asked is not None:
        return asked
    # what this process may use, which in a container is less than what the machine has
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
