"""``drs reproduce``: its options, and what it prints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drs_core.files import check_writable, write_atomically
from drs_core.options import Backend, Json, Workers, folder_named, worker_count

if TYPE_CHECKING:
    from rich.console import Console

    from drs_core.reproduce.config import ReproduceConfig
    from drs_core.reproduce.job import Job

OUTPUT = Path("runs/reproduce")


def reproduce(
    table: Annotated[str, typer.Argument(metavar="TABLE", help="I, II, III or IV.")],
    rows: Annotated[
        str | None, typer.Option(help="Numbers or names: 3,Hopper-a2c,Walker2D,*-ppo. [default: all]")
    ] = None,
    agents: Annotated[
        Path | None, typer.Option(help="Folder of the rl-zoo's agents (a2c/HopperBulletEnv-v0_1); then shipped ones.")
    ] = None,
    output: Annotated[
        Path,
        typer.Option(
            parser=folder_named, metavar="PATH", help="Folder of all rows; what is there is used and goes on."
        ),
    ] = OUTPUT,
    updates: Annotated[int, typer.Option(help="At most so many of the schedule's 200 updates a row.")] = 200,
    patience: Annotated[
        int, typer.Option(help="End a row whose evaluation has not risen for so many updates; 0 for never.")
    ] = 0,
    hours: Annotated[float | None, typer.Option(help="Time for all rows, who take turns. [default: no limit]")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the search.")] = 0,
    episodes: Annotated[
        int | None, typer.Option(help="Episodes of each evaluation. [default: the paper's 100; II: 300]")
    ] = None,
    workers: Workers = None,
    backend: Backend = "python",
    csv: Annotated[Path | None, typer.Option("--csv", help="Write all numbers, a line a row and quantity.")] = None,
    markdown: Annotated[Path | None, typer.Option("--markdown", help="Write the table as a page.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace these files if they exist.")] = False,
    as_json: Json = False,
) -> None:
    """Run a table of the paper, and print ours beside the paper's. Ctrl-C keeps all; the same command goes on."""
    import scipy.stats  # noqa: F401 - needed at the end, and better missed now

    from drs_core.reporting.console import messages, printer
    from drs_core.reporting.tables import plain_table
    from drs_core.reproduce.config import ReproduceConfig
    from drs_core.reproduce.csv_file import csv_text
    from drs_core.reproduce.result import result
    from drs_core.reproduce.tables import markdown as page
    from drs_core.reproduce.tables import sentences, sheets
    from drs_core.signals import terminated_like_interrupted

    config = ReproduceConfig(
        table=table,
        rows=rows,
        agents=agents,
        output=output,
        updates=updates,
        patience=patience,
        seed=seed,
        hours=hours,
        workers=worker_count(workers),
        backend=backend,
        episodes=episodes,
    )
    for path in filter(None, (csv, markdown)):
        check_writable(path, force)
    with printer(as_json) as out, terminated_like_interrupted():
        jobs, skipped = _run(config, messages())
        found = result(config, _command(config), jobs, skipped)
        if csv:
            write_atomically(csv, csv_text(found).encode())
        if markdown:
            write_atomically(markdown, page(found).encode())
        out.show(found, *(plain_table(s.title, s.heads, s.rows) for s in sheets(found)), *sentences(found))


def _run(config: ReproduceConfig, console: Console) -> tuple[list[Job], dict[str, str]]:
    from drs_core.reproduce.grid import prepare, run_grid
    from drs_core.reproduce.paper import paper_rows
    from drs_core.reproduce.progress import ReproduceProgress
    from drs_core.reproduce.selection import select

    jobs, skipped = prepare(select(paper_rows(config.table), config.rows), config)
    for name, why in skipped.items():
        console.print(f"{name} is skipped. {why}")
    try:
        with ReproduceProgress(console, jobs, config.updates) as progress:
            run_grid(jobs, config.hours, progress)
    except KeyboardInterrupt:
        console.print(f"Stopped; all is kept in {config.output}, and the same command goes on.")
        raise
    return jobs, skipped


def _command(config: ReproduceConfig) -> str:
    """The command line without paths, which say nothing to others."""
    import shlex
    from dataclasses import fields

    given = {
        field.name: getattr(config, field.name)
        for field in fields(config)
        if field.name not in ("table", "output", "workers") and getattr(config, field.name) != field.default
    }
    if config.agents is not None:
        given["agents"] = "ZOO"
    options = [text for name, value in given.items() for text in (f"--{name}", str(value))]
    return shlex.join(["drs", "reproduce", config.table, *options])
