"""A result as rows of text: for a terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drs_core.reproduce import origin
from drs_core.reproduce.paper import DIMENSION, FAILURE, RETURN
from drs_core.reproduce.result import Result
from drs_core.reproduce.stopping import COMPLETE, PATIENCE, UNFINISHED, UPDATES
from drs_core.reproduce.verdict import BETTER, EQUAL, WORSE
from drs_core.search import SearchConfig

_LABEL = {RETURN: "return", DIMENSION: "dimension", FAILURE: "failure [%]"}
_RUNS = "Runs, {} rollouts an update; the tuned agent is the newest, or the best in an evaluation on the way"
_ENDED = {COMPLETE: "complete", UPDATES: "--updates", PATIENCE: "--patience", UNFINISHED: "unfinished"}


@dataclass(frozen=True)
class Sheet:
    """A table: title, heads of the columns, rows."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]


def sheets(result: Result) -> list[Sheet]:
    """Our numbers beside the paper's, and the runs that made them."""
    numbers = [_numbers(row, name) for row in result["rows"] for name in row["quantities"]]
    heads = ["", "quantity", "paper", "before [95 %]", "after [95 %]", "mark", "gain [95 %]"]
    runs = ["", "updates", "ended by", "wall time", "tuned agent", "backend", "baseline"]
    title = f"Table {result['table']}: {result['title']}; {result['episodes']} episodes on the same seeds"
    subtitle = _RUNS.format(2 * SearchConfig.directions)
    return [Sheet(title, heads, numbers), Sheet(subtitle, runs, [_run(row) for row in result["rows"]])]


def _numbers(row: Result, name: str) -> list[str]:
    q = row["quantities"][name]
    digits = _digits(name, q["paper_after"])
    paper = f"{q['paper_before']:.{_paper_digits(name)}f} -> {q['paper_after']:.{_paper_digits(name)}f}"
    ours = [_with_interval(q, "before", digits), _with_interval(q, "after", digits)]
    return [_name(row), _LABEL[name], paper, *ours, q["mark"] or "", _with_interval(q, "gain", digits, "+")]


def _run(row: Result) -> list[str]:
    tuned = f"{row['tuned_agent']}: {row['tuned_update']}" if row["tuned_agent"] else ""
    run = [str(row["updates"]), _ENDED[row["stop_reason"]], duration(row["wall_s"]), tuned]
    return [_name(row), *run, row["backend"], row["agent"]]


def _name(row: Result) -> str:
    return f"{row['number']} {row['row']}"


def _with_interval(q: Result, key: str, digits: int, sign: str = "") -> str:
    if q[key] is None:
        return ""
    low, high = q[f"{key}_ci95"]
    return f"{q[key]:{sign}.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _digits(name: str, size: float) -> int:
    if name == RETURN:
        return 0 if abs(size) >= 100 else 1 if abs(size) >= 10 else 2
    return 2 if name == DIMENSION else 1


def _paper_digits(name: str) -> int:
    return 0 if name == RETURN else 2


def duration(seconds: float) -> str:
    """``45 s``, ``12 min``, ``3.4 h``."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def sentences(result: Result) -> Iterator[str]:
    """What is no table: the marks counted, what is unfinished, what others have made, what was left out."""
    quantities = [q for row in result["rows"] for q in row["quantities"].values()]
    for key, what in (("mark", "tuned values"), ("baseline_mark", "baselines")):
        marks = [q[key] for q in quantities if q[key]]
        if marks:
            counts = ", ".join(f"{marks.count(mark)} {mark}" for mark in (BETTER, EQUAL, WORSE))
            yield f"Ours against the paper's {what}: {counts}."
    unfinished = [row["row"] for row in result["rows"] if row["stop_reason"] == UNFINISHED]
    if unfinished:
        yield f"Unfinished: {', '.join(unfinished)}; the same command goes on."
    yield from _made_otherwise(result)
    if result["skipped"]:
        yield f"Skipped, without an agent that can be read: {', '.join(result['skipped'])}."


def _made_otherwise(result: Result) -> Iterator[str]:
    """What the command and the versions of now have not made."""
    asked = result["updates_asked"]
    further = [f"{row['row']} ({row['updates']})" for row in result["rows"] if row["updates"] > asked]
    if further:
        yield f"More updates than --updates {asked}, by an earlier command: {', '.join(further)}."
    yield from origin.sentences(result["rows"], result["versions"])


def markdown(result: Result) -> str:
    """A page's section: tables, then sentences."""
    parts = []
    for sheet in sheets(result):
        lines = [_line(sheet.heads), "|---" * len(sheet.heads) + "|", *map(_line, sheet.rows)]
        parts.append("\n".join([f"**{sheet.title}**", "", *lines]))
    packages = ", ".join(f"{name} {version}" for name, version in result["versions"].items())
    but = ", except for what is said above" if any(_made_otherwise(result)) else ""
    notes = (*sentences(result), f"Made by `{result['command']}` with {packages}{but}.")
    return "\n\n".join([*parts, "\n".join(f"- {note}" for note in notes)]) + "\n"


def _line(texts: Sequence[str]) -> str:
    return "| " + " | ".join(texts) + " |"
