"""``drs report``: its options, what is checked first, and the order of the work."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drs_core.errors import DrsError, UsageError, install
from drs_core.options import Json, Seed, Workers, worker_count

if TYPE_CHECKING:
    from drs_core.report.gather import Findings
    from drs_core.report.movie import Movie
    from drs_core.rollouts import Progress

FEWEST_EPISODES, MOST_EPISODES = 10, 10_000
_NEEDED = {"matplotlib": "matplotlib", "jinja2": "jinja2", "scipy": "scipy", "imageio_ffmpeg": "imageio-ffmpeg"}
_HEAD_BYTES = 4096


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Run folder of drs tune.")],
    before: Annotated[
        str | None, typer.Option(metavar="AGENT", help="The agent that the run began with, where it lies elsewhere.")
    ] = None,
    after: Annotated[str, typer.Option(help="newest, best (by the run's evaluations), or an agent file.")] = "newest",
    episodes: Annotated[int, typer.Option(help="Episodes of each agent, on the same seeds.")] = 100,
    seed: Seed = 0,
    workers: Workers = None,
    video: Annotated[bool, typer.Option(help="Film some episodes.")] = True,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page. [default: DIR/report.html]")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is no report.")] = False,
    as_json: Json = False,
) -> None:
    """Write what a run has changed as one HTML page, before and after on the same fresh seeds."""
    from drs_core.evaluation import check_seeds
    from drs_core.files import write_atomically
    from drs_core.report.gather import gather, start_agent, tuned_agent
    from drs_core.report.page import render
    from drs_core.report.run import read_run
    from drs_core.reporting.console import printer

    run = read_run(folder)
    path = output or folder / "report.html"
    _check_page(path, force)
    if not FEWEST_EPISODES <= episodes <= MOST_EPISODES:
        raise UsageError(f"episodes is {episodes}; allowed are {FEWEST_EPISODES} to {MOST_EPISODES}.")
    check_seeds(episodes, seed)
    _check_packages(video)
    start = start_agent(run, before)
    tuned = tuned_agent(run, start, after)
    count = worker_count(workers)
    with printer(as_json) as out:
        findings = gather(run, start, tuned, episodes, seed, count, _bar)
        movie, why = _movie(findings, count) if video else (None, "Made without a film (--no-video).")
        page = render(findings, movie, why).encode()
        write_atomically(path, page)
        out.show(_result(path, page, movie, findings), f"{path}: {len(page) / 1e6:.1f} MB, one page. Open it.")


def _check_page(path: Path, force: bool) -> None:
    """Find out before the work that the page could not be kept: what is there and is no report is not replaced."""
    from drs_core.report.page import GENERATOR

    if not path.absolute().parent.is_dir():
        raise UsageError(f"The folder {path.absolute().parent} does not exist; make it first.")
    if not os.access(path.absolute().parent, os.W_OK):
        raise DrsError(f"Cannot write into {path.absolute().parent}; choose another place with --output.")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file.")
    if path.exists() and not force:
        with open(path, "rb") as file:
            if f'name="generator" content="{GENERATOR}'.encode() not in file.read(_HEAD_BYTES):
                raise UsageError(f"{path} exists already and is no report; choose another name or say --force.")


def _check_packages(video: bool) -> None:
    needed = {name: package for name, package in _NEEDED.items() if video or name != "imageio_ffmpeg"}
    missing = [package for name, package in needed.items() if importlib.util.find_spec(name) is None]
    if missing:
        raise DrsError(f"A report needs {', '.join(missing)}; {install('sim,report')}.")


@contextmanager
def _bar(label: str, total: int) -> Iterator[Progress]:
    from drs_core.reporting.console import messages
    from drs_core.reporting.progress import EpisodeProgress

    with EpisodeProgress(messages(), label, total) as bar:
        yield bar


def _movie(findings: Findings, workers: int) -> tuple[Movie | None, str]:
    """The film, or why there is none: an environment that cannot be drawn costs the page nothing else."""
    from drs_core.report.film import Take, every_steps, film_all
    from drs_core.report.movie import Scene, make_movie

    sides = findings.sides
    longest = max(episode.length for side in sides for episode in side.shown)
    every = every_steps(findings.step_s, longest)
    takes = [Take(findings.run.environment, episode, every) for side in sides for episode in side.shown]
    try:
        with _bar("filming", len(takes)) as progress:
            clips = film_all(takes, workers, progress)
        count = len(findings.before.shown)
        scenes = [
            Scene(f"seed {episode.seed}", clips[place::count], [side.shown[place] for side in sides])
            for place, episode in enumerate(findings.before.shown)
        ]
        return make_movie(scenes, [side.label for side in sides], every * findings.step_s, findings.step_s), ""
    except DrsError as error:
        return None, f"There is no film: {error}"


def _result(path: Path, page: bytes, movie: Movie | None, findings: Findings) -> dict[str, Any]:
    from drs_core.report.verdict import lines

    table = lines(findings.before.summary, findings.compared)
    return {
        "output": str(path),
        "bytes": len(page),
        "video_bytes": len(movie.mp4) if movie else None,
        "updates_done": findings.done,
        "updates": findings.run.config.search.updates,
        "shown_seeds": [episode.seed for episode in findings.before.shown],
        "verdicts": {line.key: line.verdict for line in table if line.verdict},
    }
