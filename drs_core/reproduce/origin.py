"""With which versions of packages a row was made, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from drs_core.errors import presentable
from drs_core.reproduce.job import AFTER, BEFORE, TUNING
from drs_core.versions import Part, Versions, elsewhere, kept, listed

UNKNOWN = "unknown"
_COUNTERS = {TUNING: "update", BEFORE: "episode", AFTER: "episode"}


def records(made_with: dict[str, list[Part]]) -> dict[str, list[dict[str, Any]]]:
    """What a result keeps: for tuning from which update on, for an evaluation from which episode on, and which."""
    return {stage: kept(parts, _COUNTERS[stage]) for stage, parts in made_with.items()}


def in_line(row: dict[str, Any]) -> str:
    """``numpy 1.26.0 and 2.2.6; pybullet 3.2.5``: all that made a row; empty where nothing is made yet."""
    parts = _parts(row)
    known = [f"{name} {listed(versions)}" for name, versions in elsewhere(parts, {}).items()]
    unknown = [] if all(part.versions for part in parts) else [f"in part {UNKNOWN}" if known else UNKNOWN]
    return "; ".join(known + unknown)


def sentences(rows: list[dict[str, Any]], now: Versions) -> Iterator[str]:
    """One for the rows that were made with the same others than `now`."""
    found: dict[str, list[str]] = {}
    for row in rows:
        how = _others(_parts(row), now)
        if how:
            found.setdefault(how, []).append(row["row"])
    for how, names in found.items():
        yield presentable(f"{listed(names)} {'were' if names[1:] else 'was'} made {how}.")


def _others(parts: list[Part], now: Versions) -> str:
    """``in part with numpy 1.26.0``; empty where all was made with `now`."""
    others = [f"{name} {listed(versions)}" for name, versions in elsewhere(parts, now).items()]
    if not all(part.versions for part in parts):
        others.append(f"versions that are {UNKNOWN}")
    if not others:
        return ""
    ours = any(part.versions and not elsewhere([part], now) for part in parts)
    return f"{'in part ' if ours else ''}with {listed(others)}"


def _parts(row: dict[str, Any]) -> list[Part]:
    made_with = row["made_with"].items()
    return [Part(record[_COUNTERS[stage]], record["versions"]) for stage, records in made_with for record in records]
