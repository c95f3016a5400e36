"""``drs bench``: its options, and what it prints."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from drs_core.options import Json


def bench(
    environments: Annotated[
        str | None, typer.Option(help="Ids, or how they begin: Hopper,PandaReach. [default: all of the paper's]")
    ] = None,
    variants: Annotated[
        str | None, typer.Option(help="authors, ars, evotorch, python, workers_1, ... [default: all]")
    ] = None,
    rounds: Annotated[int, typer.Option(help="Turns of each variant.")] = 7,
    steps: Annotated[
        int | None, typer.Option(help="Environment steps of a turn. [default: as many as drs takes in 0.25 s]")
    ] = None,
    zoo: Annotated[
        Path | None, typer.Option("--agents", help="Folder of rl-zoo agents to run. [default: shipped ones, or random]")
    ] = None,
    updates: Annotated[bool, typer.Option(help="Measure whole updates too.")] = True,
    table: Annotated[
        Path | None, typer.Option("--markdown", help="Write the tables into this page, between its marks.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure speed against the physics alone and against peers, in turn in one run."""
    from drs_core.bench.config import BenchConfig, environment_ids, names
    from drs_core.bench.progress import BenchProgress
    from drs_core.bench.run import run_bench
    from drs_core.bench.tables import markdown, sentences, sheets, write_markdown
    from drs_core.reporting.console import messages, printer
    from drs_core.reporting.tables import plain_table

    config = BenchConfig(environment_ids(environments), names(variants), rounds, steps, agents=zoo, updates=updates)
    with printer(as_json) as out, BenchProgress(messages()) as progress:
        result = run_bench(config, progress)
        if table:
            write_markdown(table, markdown(result, _command(environments, variants, rounds, steps, zoo)))
        tables = [plain_table(sheet.title, sheet.heads, sheet.rows) for sheet in sheets(result)]
        out.show(result, *tables, *sentences(result))


def _command(environments: str | None, variants: str | None, rounds: int, steps: int | None, zoo: Path | None) -> str:
    """The command line, without paths: they say nothing to others."""
    from drs_core.bench.config import BenchConfig

    given = {"environments": environments, "variants": variants, "steps": steps, "agents": "ZOO" if zoo else None}
    given["rounds"] = rounds if rounds != BenchConfig.rounds else None
    return " ".join(["drs bench", *(f"--{name} {value}" for name, value in given.items() if value is not None)])
