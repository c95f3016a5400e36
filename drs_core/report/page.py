"""The page: one HTML file that loads nothing and runs nothing. Every text in it is escaped."""

from __future__ import annotations

import base64
from importlib.resources import files
from itertools import pairwise
from typing import Any

from drs_core import __version__
from drs_core.report import provenance, repeat
from drs_core.report.gather import QUANTILES, Findings
from drs_core.report.movie import Movie
from drs_core.report.panels import curve_panels, distribution_panels, space_panels, tip_panels
from drs_core.report.verdict import BETTER, WORSE, Headline, headline, lines, number
from drs_core.versions import Part, installed, listed, others

GENERATOR = "drs report"
"""What the page's meta element ``generator`` begins with: such a page may be replaced."""


def render(findings: Findings, movie: Movie | None, without_movie: str) -> str:
    """The whole page; `without_movie` says why there is no film, if there is none."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_kept_together
    )
    template = environment.from_string(_text("page.html.j2"))
    return template.render(style=_text("page.css"), **_context(findings, movie, without_movie))


def _kept_together(value: Any) -> Any:
    """Text whose numbers keep their percent signs at the end of a line."""
    return value.replace(" %", "\N{NO-BREAK SPACE}%") if type(value) is str else value


def _text(name: str) -> str:
    return files("drs_core.report").joinpath(name).read_text(encoding="utf-8")


def _context(findings: Findings, movie: Movie | None, without_movie: str) -> dict[str, Any]:
    run, evaluation = findings.run, findings.before.evaluation
    first = _headline(findings)
    table = lines(findings.before.summary, findings.compared)
    distributions, constants = distribution_panels(findings)
    return {
        "agent": repeat.portable(run.name),
        "environment": run.environment,
        "version": __version__,
        "generator": f"{GENERATOR} {__version__}",
        "headline": first,
        "notes": _notes(findings),
        "cards": [line for key in first.keys for line in table if line.key == key],
        "table": table,
        "episodes": len(evaluation.episodes),
        "last_seed": evaluation.seed + len(evaluation.episodes) - 1,
        "first_seed": evaluation.seed,
        "compared": findings.compared,
        "shown_seed": findings.before.shown[0].seed,
        "shown_how": _shown_how(findings),
        "returns": [(side.label, number(side.shown[0].return_, ".6g")) for side in findings.sides],
        "movie": movie,
        "mp4": _data("video/mp4", movie.mp4) if movie else "",
        "still": _data("image/jpeg", movie.still) if movie else "",
        "without_movie": without_movie,
        "movie_caption": _movie_caption(findings),
        "tip": tip_panels(findings),
        "space": space_panels(findings),
        "distributions": distributions,
        "constants": constants,
        "curves": curve_panels(findings),
        "tuned_how": provenance.tuned_how(findings),
        "origin": provenance.origin(findings),
        "history": provenance.history(findings),
        "commands": repeat.commands(findings),
        "settings": repeat.parameter_file(run),
        "versions": run.versions,
        "resumed": _resumed(run.made_with),
        "other_versions": others(run.made_with, installed(), "run"),
        "identities": repeat.identities(findings),
        "verdict_class": {BETTER: "good", WORSE: "bad"},
        "sides": [side.label for side in findings.sides],
    }


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _headline(findings: Findings) -> Headline:
    if findings.compared:
        return headline(findings.run.config.objective.name, findings.compared)
    keys = tuple(key for key in ("return_mean", "success_percent", "tip_speed_mean") if key in findings.before.summary)
    keys = tuple(key for key in keys if findings.before.summary[key] is not None)
    sentence = "No update is done yet: this page shows the agent that the run began with."
    return Headline("Not tuned yet", sentence, keys)


def _notes(findings: Findings) -> list[str]:
    search, notes = findings.run.config.search, []
    if 0 < findings.done < search.updates:
        notes.append(f"This is {findings.file}, after {findings.done} of {search.updates} updates.")
    if findings.done:
        notes.append("One run of the search, with one seed: another seed may end elsewhere.")
    return notes


def _shown_how(findings: Findings) -> str:
    measure = "speed in the goal region" if findings.before.shown[0].tip_position is not None else "return"
    return f"the episode whose {measure} is the median of all before tuning"


def _movie_caption(findings: Findings) -> str:
    seeds = [episode.seed for episode in findings.before.shown]
    measure = "tip speed in the goal region" if findings.before.shown[0].tip_position is not None else "return"
    if len(seeds) == 1:
        return f"Seed {seeds[0]} in real time: the median episode before tuning, by {measure}."
    places = [f"{100 * quantile:.0f} %" for quantile in QUANTILES[1 : len(seeds)]]
    return (
        f"Seeds {', '.join(map(str, seeds))} in real time: by {measure} before tuning, the median episode "
        f"and those at {' and '.join(places)} of all."
    )


def _resumed(made_with: list[Part]) -> list[str]:
    """A sentence for every time that the run went on with other versions than before."""
    sentences = []
    for before, part in pairwise(made_with):
        what = listed(others([before], part.versions, "before")) or "other versions"
        when = f"After update {part.begin}" if part.begin else "Before its first update"
        sentences.append(f"{when} the run went on with {what}.")
    return sentences
