"""Sample costs as rows of text."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

from drs_core.bench.tables import Sheet


def sheet(result: dict[str, Any]) -> Sheet:
    """A row an agent, a column a method: the median and, in brackets, least and greatest."""
    rows = [
        [name, f"{agent['goal']['line']:g}", *(_cell(found) for found in agent["methods"].values())]
        for name, agent in result["agents"].items()
    ]
    title = f"Rollouts until the goal: median (least-greatest) of {result['seeds']} tuning seeds"
    return Sheet(title, ["", "goal", *result["titles"].values()], rows)


def sentences(result: dict[str, Any]) -> Iterator[str]:
    """What is no table."""
    yield (
        f"Searches end after {result['rollouts']} rollouts, or with their schedule; a goal not reached by then counts "
        "as more than that. Episodes by which a search steers are counted; 100 fresh ones that say whether the goal is "
        "reached, by the lower end of the return's 95 % interval, are not."
    )
    waiting = sum(
        result["seeds"] - found["ended"] for agent in result["agents"].values() for found in agent["methods"].values()
    )
    if waiting:
        some = "1 search has not come to its" if waiting == 1 else f"{waiting} searches have not come to their"
        yield f"{some} end; the same command goes on."
    if result["missing"]:
        yield f"Without an agent: {', '.join(result['missing'])}."


def csv_text(result: dict[str, Any]) -> str:
    """A line a search that has ended; rollouts are empty where the goal was not reached."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["agent", "goal", "method", "seed", "rollouts", "most"])
    for name, agent in result["agents"].items():
        for method, found in agent["methods"].items():
            for seed, cost in zip(found["seeds"], found["costs"], strict=True):
                writer.writerow([name, agent["goal"]["line"], method, seed, cost, found["most"]])
    return text.getvalue()


def _cell(found: dict[str, Any]) -> str:
    if not found["ended"]:
        return ""
    median = f"> {found['most']}" if found["median"] is None else f"{found['median']}"
    reached = [cost for cost in found["costs"] if cost is not None]
    greatest = f"{max(reached)}" if len(reached) == found["ended"] else f"{found['reached']} of {found['ended']}"
    return f"{median} ({min(reached)}-{greatest})" if reached else f"{median} (0 of {found['ended']})"
