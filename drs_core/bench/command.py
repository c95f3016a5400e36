"""``drs bench``: its options, and what it prints."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from drs_core.errors import UsageError
from drs_core.options import Backend, Json, Workers, folder_named, worker_count

OUTPUT = Path("runs/sample_cost")
_OF_SPEED = ("environments", "variants", "rounds", "steps", "updates", "table")
_OF_SAMPLE_COST = ("rows", "methods", "seeds", "rollouts", "output", "hours", "workers", "backend", "figure", "csv")


def bench(
    context: typer.Context,
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
    sample_cost: Annotated[
        bool, typer.Option("--sample-cost", help="Measure rollouts until the paper's return instead.")
    ] = False,
    rows: Annotated[str | None, typer.Option(help="Agents, as drs reproduce I names them. [default: all]")] = None,
    methods: Annotated[str, typer.Option(help="What is compared: paper, frugal, sep_cma, ...")] = "paper,frugal",
    seeds: Annotated[int, typer.Option(help="Tuning seeds of each.")] = 5,
    rollouts: Annotated[int, typer.Option(help="A search ends after so many.")] = 5120,
    output: Annotated[
        Path, typer.Option(parser=folder_named, metavar="PATH", help="Folder of all searches; what is there goes on.")
    ] = OUTPUT,
    hours: Annotated[float | None, typer.Option(help="Time for all searches. [default: no limit]")] = None,
    workers: Workers = None,
    backend: Backend = "python",
    figure: Annotated[Path | None, typer.Option(help="Draw return against rollouts: .png, .svg, .pdf.")] = None,
    csv: Annotated[Path | None, typer.Option(help="Write every search's rollouts.")] = None,
    as_json: Json = False,
) -> None:
    """Measure speed against the physics alone and against peers; with --sample-cost, rollouts until a goal."""
    _refuse_others(context, _OF_SPEED if sample_cost else _OF_SAMPLE_COST, sample_cost)
    if sample_cost:
        from drs_core.bench.config import names
        from drs_core.bench.sample_cost import command
        from drs_core.bench.sample_cost.config import SampleCostConfig

        wanted = SampleCostConfig(
            rows, names(methods), seeds, rollouts, zoo, output, hours, worker_count(workers) or 1, backend
        )
        command.sample_cost(wanted, figure, csv, as_json)
        return
    from drs_core.bench.config import BenchConfig, environment_ids, names
    from drs_core.bench.progress import BenchProgress
    from drs_core.bench.run import run_bench
    from drs_core.bench.tables import check_markdown, markdown, sentences, sheets, write_markdown
    from drs_core.reporting.console import messages, printer
    from drs_core.reporting.tables import plain_table

    config = BenchConfig(environment_ids(environments), names(variants), rounds, steps, agents=zoo, updates=updates)
    if table:
        check_markdown(table)
    with printer(as_json) as out, BenchProgress(messages()) as progress:
        result = run_bench(config, progress)
        if table:
            write_markdown(table, markdown(result, _command(environments, variants, rounds, steps, zoo)))
        tables = [plain_table(sheet.title, sheet.heads, sheet.rows) for sheet in sheets(result)]
        out.show(result, *tables, *sentences(result))


def _refuse_others(context: typer.Context, names: tuple[str, ...], sample_cost: bool) -> None:
    """Raise UsageError where an option of the other measurement is given: it would do nothing."""
    for option in context.command.params:
        source = context.get_parameter_source(option.name or "")
        if option.name in names and source is not None and source.name == "COMMANDLINE":
            beside = "with --sample-cost; leave one out" if sample_cost else "without --sample-cost; add that"
            raise UsageError(f"{option.opts[0]} does nothing {beside}.")


def _command(environments: str | None, variants: str | None, rounds: int, steps: int | None, zoo: Path | None) -> str:
    """The command line, without paths: they say nothing to others."""
    from drs_core.bench.config import BenchConfig

    given = {"environments": environments, "variants": variants, "steps": steps, "agents": "ZOO" if zoo else None}
    given["rounds"] = rounds if rounds != BenchConfig.rounds else None
    return " ".join(["drs bench", *(f"--{name} {value}" for name, value in given.items() if value is not None)])
