"""A benchmark's result as rows of text, for the terminal and for the docs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drs_core.accelerator import PYTHON
from drs_core.bench.variants import pairs
from drs_core.errors import UsageError
from drs_core.files import check_writable, read_bounded, write_atomically

BEGIN, END = "<!-- drs bench: begin -->", "<!-- drs bench: end -->"

_MOST_PAGE_BYTES = 2**24
FREE_CORE = 0.9
"""Of a core, in the median over rounds: with less, somebody else was at work."""
THROUGHPUTS = ("workers_2/workers_1", "ros/workers_2")

Result = dict[str, Any]


@dataclass(frozen=True)
class Sheet:
    """A table: title, heads of the columns, rows; the first column is text, the others are numbers."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]


def sheets(result: Result) -> list[Sheet]:
    """CPU time, wall time, ratios, and the environments' agents."""
    titles = result["titles"]
    shown = [name for name in titles if any(name in e["variants"] for e in result["environments"].values())]
    heads = ["", *(titles[name] for name in shown)]
    return [
        Sheet(
            "CPU time of an environment step [us], policy included",
            heads,
            _rows(result, lambda e: [_number(e["variants"].get(name), "cpu_us_per_step") for name in shown]),
        ),
        Sheet(
            "Wall time of 128 rollouts [s]",
            heads,
            _rows(
                result,
                lambda e: [
                    "" if name == "physics" else _number(e["variants"].get(name), "wall_s_per_128_rollouts")
                    for name in shown
                ],
            ),
        ),
        _ratios(result),
        Sheet(
            "Agents and workers",
            ["", "agent", "steps of an episode", "worker's memory [MB]"],
            _rows(
                result,
                lambda e: [
                    e["agent"],
                    f"{e['episode_steps']:.0f}",
                    "" if e["worker_memory_mb"] is None else f"{e['worker_memory_mb']:.0f}",
                ],
            ),
        ),
    ]


def _ratios(result: Result) -> Sheet:
    environments = result["environments"].values()
    cpu = [f"{over}/{under}" for over, under in pairs() if any(f"{over}/{under}" in e["ratios"] for e in environments)]
    wall = [
        name for name in ("workers_2/workers_1", "ros/workers_2") if any(name in e["throughput"] for e in environments)
    ]

    def cells(e: Result) -> list[str]:
        return [spread_text(e["ratios"].get(name)) for name in cpu] + [
            spread_text(e["throughput"].get(name)) for name in wall
        ]

    heads = [
        "",
        *(name.replace("/", " / ") for name in cpu),
        *(name.replace("/", " / ") + ", steps/s" for name in wall),
    ]
    return Sheet("Ratios, median (least-greatest) over the rounds", heads, _rows(result, cells))


def sentences(result: Result) -> Iterator[str]:
    """What is no table: left out variants, updates, the machine."""
    whys: dict[tuple[str, str], list[str]] = {}
    for environment, e in result["environments"].items():
        for name, why in e["skipped"].items():
            whys.setdefault((name, why.replace(environment, "this one")), []).append(environment)
    for (name, why), where in whys.items():
        everywhere = len(where) == len(result["environments"])
        yield f"Left out{'' if everywhere else ' in ' + ', '.join(where)}: {result['titles'][name]}: {why}"
    for name, e in result["updates"].items():
        yield _update_sentence(name, e)
    yield from _busy_machine(result)
    m = result["machine"]
    packages = ", ".join(f"{name} {version}" for name, version in m["packages"].items())
    yield (
        f"Medians of {result['rounds']} rounds. {m['processor']}, {m['cores']} cores, {m['memory_gb']:g} GB, "
        f"{m['system']}, Python {m['python']}; {packages}."
    )


def _busy_machine(result: Result) -> Iterator[str]:
    """A rollout in this process computes all the time; where it got less than a core, others had the rest."""
    got = [e["variants"][PYTHON]["cores_used"] for e in result["environments"].values() if PYTHON in e["variants"]]
    if got and min(got) < FREE_CORE:
        yield (
            f"The machine was busy with other work: a process that never waits got {min(got):.0%} of a core. "
            "Wall times, and what follows from them, are those of a busy machine."
        )


def _update_sentence(name: str, e: Result) -> str:
    figure = spread_text(e)
    if name == "dimension_over_return":
        return (
            f"An update with the objective dimension takes {figure} times the CPU time of one with return "
            f"({e['environment']})."
        )
    if name == "tail_percent":
        return (
            f"Not all of {e['workers']} workers compute during {figure} % of the wall time of an update "
            f"of {e['rollouts']} rollouts ({e['environment']})."
        )
    share = f"{figure} % of an update's CPU time at {e['parameters']} parameters"
    return f"The search's own work is {share} ({e['environment']})."


def spread_text(spread: Result | None) -> str:
    """``median (least-greatest)``, three digits each."""
    if spread is None:
        return ""
    return f"{_short(spread['median'])} ({_short(spread['low'])}-{_short(spread['high'])})"


def markdown(result: Result, command: str) -> str:
    """The docs' section, between its marks."""
    parts = [BEGIN, f"Made by `{command}`."]
    for sheet in sheets(result):
        lines = [f"**{sheet.title}**", "", _line(sheet.heads), "|---" + "|---:" * (len(sheet.heads) - 1) + "|"]
        parts.append("\n".join([*lines, *map(_line, sheet.rows)]))
    parts.append("\n".join(f"- {sentence}" for sentence in sentences(result)))
    return "\n\n".join([*parts, END]) + "\n"


def check_markdown(path: Path) -> None:
    """Find out before the work that its tables could not be kept.

    Raises:
        UsageError: the page has no marks, or cannot be read or written.
    """
    check_writable(path, force=True)
    if path.exists():
        _around_marks(path)


def write_markdown(path: Path, section: str) -> None:
    """Write a new file, or replace what stands between the marks in one that is there.

    Raises:
        DrsError: the file has no marks, or cannot be written.
    """
    if path.exists():
        before, after = _around_marks(path)
        section = before + section.rstrip("\n") + after
    write_atomically(path, section.encode())


def _around_marks(path: Path) -> tuple[str, str]:
    try:
        text = read_bounded(path, _MOST_PAGE_BYTES).decode()
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is not a page of text; choose another file.") from error
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise UsageError(f"{path} has no lines {BEGIN} and {END}; the tables go between them.")
    return before, after


def _rows(result: Result, cells: Callable[[Result], list[str]]) -> list[list[str]]:
    return [[name, *cells(e)] for name, e in result["environments"].items()]


def _number(variant: Result | None, key: str) -> str:
    return "" if variant is None else _short(variant[key])


def _short(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:#.3g}".rstrip(".")


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
