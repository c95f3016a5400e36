"""``drs bench --sample-cost``: what it prints."""

from __future__ import annotations

from pathlib import Path

from drs_core.bench.sample_cost.config import SampleCostConfig


def sample_cost(config: SampleCostConfig, figure: Path | None, csv: Path | None, as_json: bool) -> None:
    """Run what is not kept yet, then print, draw and write what is."""
    import scipy.stats  # noqa: F401 - needed at the end, and better missed now

    from drs_core.bench.sample_cost.agents import subjects
    from drs_core.bench.sample_cost.figure import draw
    from drs_core.bench.sample_cost.grid import jobs, run_jobs
    from drs_core.bench.sample_cost.job import Job
    from drs_core.bench.sample_cost.summary import result
    from drs_core.bench.sample_cost.tables import csv_text, sentences, sheet
    from drs_core.files import check_writable, write_atomically
    from drs_core.reporting.console import messages, printer
    from drs_core.reporting.figures import check_figure_file
    from drs_core.reporting.progress import EpisodeProgress
    from drs_core.reporting.tables import plain_table
    from drs_core.signals import terminated_like_interrupted

    if figure:
        check_figure_file(figure)
    if csv:
        check_writable(csv, force=True)
    console = messages()
    with printer(as_json) as out, terminated_like_interrupted():
        found, missing = subjects(config)
        work = jobs(config, found)
        with EpisodeProgress(console, f"searches of {len(found)} agents", len(work)) as progress:

            def observe(job: Job, done: int) -> None:
                progress(done)
                console.print(f"{job.path.parent.parent.name}, {job.entry.title}, seed {job.seed}: {job.said()}")

            run_jobs(work, config, observe)
        told = result(config, found, missing, work)
        if figure:
            draw(told, figure)
        if csv:
            write_atomically(csv, csv_text(told).encode())
        table = sheet(told)
        out.show(told, plain_table(table.title, table.heads, table.rows), *sentences(told))
