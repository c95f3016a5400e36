"""Which rows of a table: ``--rows 3,Hopper-a2c,Panda*``."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from drs_core.errors import UsageError
from drs_core.reproduce.paper import PaperRow


def select(rows: Sequence[PaperRow], asked: str | None) -> list[PaperRow]:
    """Rows in the table's order: by number, by name, by environment or by a pattern with ``*``; None for all.

    Raises:
        UsageError: a word fits no row.
    """
    if asked is None:
        return list(rows)
    words = [word.strip() for word in asked.split(",") if word.strip()]
    wrong = [word for word in words or [asked] if not any(fits(row, word) for row in rows)]
    if wrong:
        raise UsageError(f"No row is called {wrong[0][:80]!r}; there are 1 to {len(rows)}: {names(rows)}.")
    return [row for row in rows if any(fits(row, word) for word in words)]


def fits(row: PaperRow, word: str) -> bool:
    """Whether a row is meant by a number, ``Hopper-a2c``, ``Hopper``, ``HopperBulletEnv-v0``, ``*-a2c``."""
    if word.isdecimal():
        return row.number == int(word)
    word = word.lower()
    known = (row.name, row.name.rpartition("-")[0], row.environment, f"{row.environment}-{row.algorithm}")
    return any(fnmatchcase(name.lower(), word) for name in known)


def names(rows: Sequence[PaperRow]) -> str:
    """``Hopper-a2c/ppo, Ant-a2c/ppo``: short enough for a message."""
    grouped: dict[str, list[str]] = {}
    for row in rows:
        grouped.setdefault(row.name.rpartition("-")[0], []).append(row.algorithm)
    return ", ".join(f"{name}-{'/'.join(algorithms)}" for name, algorithms in grouped.items())
