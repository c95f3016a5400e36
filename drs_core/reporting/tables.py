"""Results as tables for a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table
from rich.text import Text

Summary = dict[str, Any]


@dataclass(frozen=True)
class Row:
    """One measure: label, key in a summary, key of its interval, number format, key among the differences."""

    label: str
    key: str
    interval: str | None = None
    form: str = ".4g"
    difference: str | None = None


ROWS = (
    Row("return", "return_mean", "return_ci95", ".2f", "return"),
    Row("return, standard deviation", "return_std", None, ".2f"),
    Row("length [steps]", "length_mean", None, ".1f"),
    Row("failure [%]", "failure_percent", "failure_ci95", ".1f"),
    Row("success [%]", "success_percent", "success_ci95", ".1f"),
    Row("mesh dimension", "dimension_mean", "dimension_ci95", ".2f", "dimension"),
    Row("action change", "action_change_mean", None, ".4f", "action_change"),
    Row("tip speed in the goal region [m/s]", "tip_speed_mean", "tip_speed_ci95", ".4f", "tip_speed"),
    Row("tip jerk^2 in the goal region [(m/s^3)^2]", "tip_jerk_mean_square", "tip_jerk_ci95", ".3g", "tip_jerk"),
    Row("tip position, standard deviation [m]", "tip_position_std", "tip_position_std_ci95", ".5f", "tip_position_std"),
    Row("velocity sign flips [1/step]", "velocity_sign_flips", "velocity_sign_flips_ci95", ".3f"),
    Row("log dimensionless jerk", "log_dimensionless_jerk", "log_dimensionless_jerk_ci95", ".2f"),
)


def cell(summary: Summary, row: Row) -> str:
    """``mean [low, high]`` or ``mean``."""
    value = format(summary[row.key], row.form)
    # one episode has none
    if row.interval is None or summary[row.interval] is None:
        return value
    low, high = (format(end, row.form) for end in summary[row.interval])
    return f"{value}  [{low}, {high}]"


def evaluation_table(summary: Summary) -> Table:
    """The table of ``drs evaluate``."""
    title = (
        f"{summary['agent']} in {summary['environment']}: {summary['episodes']} episodes from seed {summary['seed']}"
    )
    return _table(title, ["mean [95 % interval]"], summary, lambda row: [cell(summary, row)])


def comparison_table(result: dict[str, Any]) -> Table:
    """The table of ``drs compare``."""
    before, after = result["before"], result["after"]
    title = f"{before['environment']}: {before['episodes']} episodes on the same seeds from {before['seed']}"

    def better(row: Row) -> str:
        probability = result["differences"].get(row.difference, {}).get("probability_after_better")
        return "" if probability is None else f"{probability:.3f}"

    columns = ["before [95 % interval]", "after [95 % interval]", "P(after better)"]
    return _table(title, columns, before, lambda row: [cell(before, row), cell(after, row), better(row)])


def _table(title: str, columns: list[str], summary: Summary, cells: Callable[[Row], list[str]]) -> Table:
    table = Table("", *columns, title=Text(title), title_justify="left", title_style="bold")
    for row in ROWS:
        if summary.get(row.key) is not None:
            table.add_row(*map(Text, [row.label, *cells(row)]))
    return table


def plain_table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Text under heads, numbers to the right."""
    table = Table(title=Text(title), title_justify="left", title_style="bold")
    for index, head in enumerate(heads):
        table.add_column(Text(head), justify="right" if index else "left", no_wrap=not index)
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def comparison_sentence(result: dict[str, Any]) -> str:
    """What a comparison says of the return, in one sentence."""
    difference = result["differences"]["return"]
    ends = difference["ci95"]
    interval = f"[{ends[0]:.3f}, {ends[1]:.3f}]" if ends else "(one episode has no interval)"
    return (
        f"Return after minus before: {difference['mean']:.3f} {interval}; "
        f"{result['episodes_better']} episodes better, {result['episodes_equal']} equal, "
        f"{result['episodes_worse']} worse."
    )


def observed_line(normalised: bool, time_feature: bool) -> str:
    """What an imported policy is given to see: the commonest mistake is a zip that was moved without its normaliser."""
    seen = "are normalised by its vecnormalize.pkl" if normalised else "are not normalised"
    advice = "" if normalised else " If it was trained with a VecNormalize, give its file with --vecnormalize."
    return f"Observations {seen}, {'with' if time_feature else 'without'} a time feature.{advice}"


def agent_line(row: dict[str, Any]) -> str:
    """What ``drs agents`` says of one: who trained it, in what, and how good it was when it was chosen."""
    source, result = row["source"], row["source"].get("evaluation", {})
    imitates = source.get("settings", {}).get("imitate", 0) >= source.get("steps", math.inf)
    how = f"{source['algorithm']}{' by imitation of a teacher' if imitates else ''}"
    line = f"{row['name']}: {how}, {row['environment']}, {row['parameters']} parameters"
    if result:
        line += f"; return {result['return_mean']:.2f} +- {result['return_std']:.2f}"
    return line + (f", success {result['success_percent']:.0f} %" if result.get("success_percent") is not None else "")
