"""A result as rows of text: for a terminal, as Markdown, and one line a quantity as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

from drs_core.reproduce.paper import DIMENSION, FAILURE, RETURN
from drs_core.reproduce.result import Result

HEADS = (
    "row",
    "quantity",
    "paper",
    "ours [95 %]",
    "against the paper",
    "gain [95 %]",
    "updates",
    "wall time",
    "agent",
)
_LABEL = {RETURN: "return", DIMENSION: "dimension", FAILURE: "failure [%]"}
_DIGITS = {RETURN: 1, DIMENSION: 2, FAILURE: 1}


def title(result: Result) -> str:
    """Over the table."""
    return f"Table {result['table']}: {result['title']}; {result['episodes']} episodes on the same seeds"


def cells(result: Result) -> list[list[str]]:
    """A line a row and quantity, under HEADS."""
    return [_cells(row, name, place) for row in result["rows"] for place, name in enumerate(row["quantities"])]


def _cells(row: Result, name: str, place: int) -> list[str]:
    q, digits = row["quantities"][name], _DIGITS[name]
    ours = _with_interval(q, "before", digits)
    if q["after"] is not None:
        ours += f" -> {_with_interval(q, 'after', digits)}"
    which = f", {row['tuned_agent']} of update {row['tuned_update']}" if row["tuned_agent"] == "best" else ""
    return [
        "" if place else f"{row['number']} {row['row']}",
        _LABEL[name],
        f"{_number(q['paper_before'], name)} -> {_number(q['paper_after'], name)}",
        ours,
        q["mark"] or "",
        _with_interval(q, "gain", digits, "+"),
        *(["", "", ""] if place else [_updates(row), duration(row["wall_s"]), f"{row['agent']}{which}"]),
    ]


def _with_interval(q: Result, key: str, digits: int, sign: str = "") -> str:
    if q[key] is None:
        return ""
    low, high = q[f"{key}_ci95"]
    return f"{q[key]:{sign}.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _number(value: float, name: str) -> str:
    return f"{value:.0f}" if name == RETURN else f"{value:.{_DIGITS[name]}f}"


def _updates(row: Result) -> str:
    return f"{row['updates']}, {row['state']}"


def duration(seconds: float) -> str:
    """``45 s``, ``12 min``, ``3.4 h``."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def sentences(result: Result) -> Iterator[str]:
    """What is no table: marks, backends, what was left out."""
    marks = [q["mark"] for row in result["rows"] for q in row["quantities"].values() if q["mark"]]
    if marks:
        counted = ", ".join(f"{marks.count(name)} {name}" for name in ("better", "equal", "worse"))
        yield f"Against the paper's tuned values: {counted}."
    backends = sorted({row["backend"] for row in result["rows"]})
    for backend in backends:
        rows = [row["row"] for row in result["rows"] if row["backend"] == backend]
        yield f"Backend {backend}{': ' + ', '.join(rows) if len(backends) > 1 else ''}."
    unfinished = [row["row"] for row in result["rows"] if row["state"] == "unfinished"]
    if unfinished:
        yield f"Unfinished: {', '.join(unfinished)}; the same command goes on."
    whys: dict[str, list[str]] = {}
    for name in result["skipped"]:
        whys.setdefault("no agent", []).append(name)
    for why, names in whys.items():
        yield f"Skipped, {why}: {', '.join(names)}."


def markdown(result: Result) -> str:
    """A page's table and the sentences below it."""
    lines = [_line(HEADS), "|---" * len(HEADS) + "|", *map(_line, cells(result))]
    package = ", ".join(f"{name} {version}" for name, version in result["versions"].items())
    notes = [f"- {sentence}" for sentence in (*sentences(result), f"Made by `{result['command']}`; {package}.")]
    return "\n".join([f"**{title(result)}**", "", *lines, "", *notes]) + "\n"


def _line(texts: Any) -> str:
    return "| " + " | ".join(texts) + " |"


def csv_text(result: Result) -> str:
    """One line a row and quantity, all digits; intervals as two columns, nothing where there is nothing."""
    versions = "; ".join(f"{name} {version}" for name, version in result["versions"].items())
    lines = []
    for row in result["rows"]:
        shared = {key: value for key, value in row.items() if key not in ("quantities", "folder")}
        for name, q in row["quantities"].items():
            line = {"table": result["table"], **shared, "episodes": result["episodes"], "quantity": name}
            for key, value in q.items():
                if key.endswith("_ci95"):
                    line[f"{key}_low"], line[f"{key}_high"] = value or (None, None)
                else:
                    line[key] = value
            lines.append(line | {"command": result["command"], "versions": versions})
    text = io.StringIO()
    writer = csv.DictWriter(text, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()
