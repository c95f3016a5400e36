"""What may be said of before and after: numbers as people write them, and better, worse or neither."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from drs_core.measures.statistics import CONFIDENCE
from drs_core.reporting.tables import ROWS, Row

BETTER, WORSE, UNCLEAR, EQUAL = "better", "worse", "no clear difference", "the same"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Cell:
    """A mean and its interval, as text; no interval where none was computed."""

    value: str
    interval: str | None = None


@dataclass(frozen=True)
class Line:
    """One measure: before, after, their paired difference and the verdict on it, as far as there are any."""

    key: str
    label: str
    unit: str
    before: Cell
    after: Cell | None
    difference: Cell | None
    verdict: str | None


def number(value: float, form: str) -> str:
    """A number as in ``drs compare``, with a true minus and powers of ten."""
    text = format(value, form)
    if float(text) == 0.0:
        text = text.lstrip("-")
    mantissa, _, exponent = text.partition("e")
    power = f"\N{MULTIPLICATION SIGN}10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if exponent else ""
    return mantissa.replace("-", "\N{MINUS SIGN}") + power


def interval(ends: list[float], form: str) -> str:
    """``[low, high]``."""
    return f"[{number(ends[0], form)}, {number(ends[1], form)}]"


def verdict(difference: dict[str, Any]) -> str:
    """Of a paired difference of `drs_core.evaluation.comparison`: clear if its 95 % interval leaves out 0."""
    if difference["mean"] == 0.0 and difference["ci95"] == [0.0, 0.0]:
        return EQUAL
    tail = (1.0 - CONFIDENCE) / 2.0
    better: float = difference["probability_after_better"]
    return BETTER if better >= 1.0 - tail else WORSE if better <= tail else UNCLEAR


def lines(before: dict[str, Any], compared: dict[str, Any] | None) -> list[Line]:
    """The table of before and after: the rows of ``drs compare``."""
    return [_line(row, before, compared) for row in ROWS if before.get(row.key) is not None]


def _line(row: Row, before: dict[str, Any], compared: dict[str, Any] | None) -> Line:
    difference = compared["differences"].get(row.difference) if compared else None
    label, _, unit = row.label.replace("^2", "²").replace("^3", "³").partition(" [")
    return Line(
        key=row.key,
        label=label,
        unit=unit.removesuffix("]"),
        before=_cell(row, before),
        after=_cell(row, compared["after"]) if compared else None,
        difference=Cell(number(difference["mean"], row.form), interval(difference["ci95"], row.form))
        if difference
        else None,
        verdict=verdict(difference) if difference else None,
    )


def _cell(row: Row, summary: dict[str, Any]) -> Cell:
    return Cell(
        number(summary[row.key], row.form),
        interval(summary[row.interval], row.form) if row.interval else None,
    )


@dataclass(frozen=True)
class Headline:
    """What the page says first: a title, one sentence with the numbers, and the rows to show large."""

    title: str
    sentence: str
    keys: tuple[str, ...]


def headline(objective: str, compared: dict[str, Any]) -> Headline:
    """Of a comparison, by what the run was to improve."""
    main = _main(objective, compared["before"])
    table = {line.key: line for line in lines(compared["before"], compared)}
    rest: list[str] = [
        key for key in ("return_mean", "success_percent", "failure_percent") if key in table and key != main
    ]
    if "success_percent" in rest:
        rest.remove("failure_percent")
    if len(rest) < 2 and main != "dimension_mean":
        rest += ["dimension_mean"] if "dimension_mean" in table else []
    keys = (main, *rest)
    first = _said(table[main], with_intervals=True)
    others = [_said(table[key], with_intervals=False) for key in rest]
    n = compared["before"]["episodes"]
    sentence = f"{first[:1].upper()}{first[1:]}; {', '.join(others)}. Means of {n} episodes, before and after on "
    sentence += "the same seeds; in brackets 95 % intervals."
    return Headline(_title(table[main], compared) + _price(main, compared), sentence, keys)


def _main(objective: str, before: dict[str, Any]) -> str:
    if objective == "dimension":
        return "dimension_mean"
    if objective != "smooth":
        return "return_mean"
    return "tip_speed_mean" if before.get("tip_speed_mean") is not None else "action_change_mean"


def _title(line: Line, compared: dict[str, Any]) -> str:
    before, after = compared["before"][line.key], compared["after"][line.key]
    if line.verdict == EQUAL:
        return f"No difference: {_short(line)} is the same in every episode"
    if line.verdict == UNCLEAR:
        return f"No clear difference in {_short(line)}"
    if line.key in ("return_mean", "dimension_mean"):
        what = _short(line)
        value = f"{line.before.value} to {line.after.value if line.after else ''}"
        verb = "rose" if after > before else "fell"
        worse = " \N{EM DASH} it is worse" if line.verdict == WORSE else ""
        return f"{what[:1].upper()}{what[1:]} {verb} from {value}{worse}"
    times = max(before, after) / max(min(before, after), 1e-12)
    how = f"{times:.1f} times" if times < 20 else f"{times:.0f} times"
    what, less, more = (
        ("At its goal the tip moves", "slower", "faster")
        if line.key == "tip_speed_mean"
        else ("Its actions change", "less", "more")
    )
    return f"{what} {how} {less}" if line.verdict == BETTER else f"Worse: {what.lower()} {how} {more}"


def _price(main: str, compared: dict[str, Any]) -> str:
    """What a gain elsewhere costs in return, or brings: it belongs into the title."""
    difference = compared["differences"]["return"]
    said = verdict(difference)
    if main == "return_mean" or said not in (BETTER, WORSE):
        return ""
    size = number(abs(difference["mean"]), ".2g")
    return f", with {size} more return" if said == BETTER else f", for {size} less return"


def _short(line: Line) -> str:
    return {
        "return_mean": "the return",
        "dimension_mean": "the mesh dimension",
        "tip_speed_mean": "the tip's speed",
    }.get(line.key, line.label)


def _said(line: Line, with_intervals: bool) -> str:
    def told(cell: Cell) -> str:
        return f"{cell.value} {cell.interval}" if cell.interval and with_intervals else cell.value

    after = f" \N{RIGHTWARDS ARROW} {told(line.after)}" if line.after else ""
    change = f"{line.label} {told(line.before)}{after}{' ' + line.unit if line.unit else ''}"
    return f"{change} ({line.verdict})" if line.verdict else change
