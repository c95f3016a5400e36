"""Arguments and options that several commands share, and what is checked before any work."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from drs_core.errors import UsageError

AgentName = Annotated[
    str, typer.Argument(metavar="AGENT", help="Agent file, shipped name, SB3 zip, zoo folder or hf:org/name.")
]
Episodes = Annotated[int, typer.Option(help="Episodes to run.")]
Seed = Annotated[int, typer.Option(help="First episode seed; the others follow one by one.")]
Workers = Annotated[int | None, typer.Option(help="Worker processes; 0 runs in this process. [default: all cores]")]
Plain = Annotated[bool, typer.Option("--plain-stepping", help="Step as upstream does: the same episodes, slower.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")]

Where = tuple[int, bool]
"""How rollouts run: the number of workers, and whether to step fast."""


def check_output(path: Path, force: bool) -> None:
    """Find out before the work that its result could not be kept."""
    if path.suffix != ".safetensors":
        raise UsageError(f"An agent file is called *.safetensors, not {path.name}.")
    check_new(path, force)
    if not path.absolute().parent.is_dir():
        raise UsageError(f"The folder {path.absolute().parent} does not exist; make it first.")
    with tempfile.TemporaryFile(dir=path.absolute().parent):
        pass


def check_new(path: Path, force: bool) -> None:
    """Raise UsageError where the file exists and may not be replaced."""
    if path.exists() and not force:
        raise UsageError(f"{path} exists already; choose another name or say --force.")
