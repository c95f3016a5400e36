"""The paper's tables as printed, and what each of them is made with."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from drs_core.environments import current_name
from drs_core.errors import UsageError

TABLES_CSV = Path(__file__).with_name("tables.csv")

RETURN, DIMENSION, FAILURE = "return", "dimension", "failure_percent"


@dataclass(frozen=True)
class Table:
    """How a table is made.

    Attributes:
        title: what it shows.
        objective: what its agents are tuned for.
        episodes: trials of an evaluation.
    """

    title: str
    objective: str
    episodes: int


TABLES: Mapping[str, Table] = {
    "I": Table("return, tuned for return", "return", 100),
    "II": Table("failures of table I's Walker2D agents", "return", 300),
    "III": Table("mesh dimension and return, tuned for dimension", "dimension", 100),
    "IV": Table("mesh dimension and return of the Panda arm, tuned for dimension", "dimension", 100),
}


@dataclass(frozen=True)
class Printed:
    """A mean of the paper and its standard deviation over trials, None where none is printed."""

    mean: float
    std: float | None


@dataclass(frozen=True)
class PaperRow:
    """One agent of a table.

    Attributes:
        number: place in the table, from 1.
        environment: gymnasium id of today.
        algorithm: a2c, ppo, ddpg, td3, sac or tqc.
        printed: quantity -> baseline and tuned.
    """

    number: int
    environment: str
    algorithm: str
    printed: Mapping[str, tuple[Printed, Printed]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """``Hopper-a2c``."""
        return f"{re.sub(r'(BulletEnv|Continuous)?-v[0-9]+$', '', self.environment)}-{self.algorithm}"


def table(name: str) -> Table:
    """How table I, II, III or IV is made.

    Raises:
        UsageError: there is no such table.
    """
    if name not in TABLES:
        raise UsageError(f"There is no table {name!r}; choose {', '.join(TABLES)}.")
    return TABLES[name]


def paper_rows(name: str) -> list[PaperRow]:
    """The rows of a table in the paper's order.

    Raises:
        UsageError: there is no such table.
    """
    table(name)
    found: dict[tuple[str, str], dict[str, dict[str, Printed]]] = {}
    with open(TABLES_CSV, encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            if line["table"] != name:
                continue
            key = (_environment(line["environment"]), line["algorithm"].lower())
            printed = Printed(float(line["mean"]), float(line["std"]) if line["std"] else None)
            found.setdefault(key, {}).setdefault(line["quantity"], {})[line["stage"]] = printed
    return [
        PaperRow(number, *key, {name: (stages["baseline"], stages["tuned"]) for name, stages in quantities.items()})
        for number, (key, quantities) in enumerate(found.items(), 1)
    ]


def _environment(printed: str) -> str:
    # table IV prints the Panda environments without a version
    return current_name(printed if "-v" in printed else f"{printed}-v1")
