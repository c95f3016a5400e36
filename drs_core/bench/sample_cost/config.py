"""What a comparison of sample costs runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from drs_core.accelerator import check_backend
from drs_core.bench.sample_cost.methods import chosen
from drs_core.errors import UsageError

MAX_SEEDS = 100
MAX_ROLLOUTS = 1_000_000


@dataclass(frozen=True)
class SampleCostConfig:
    """Settings of a comparison.

    Attributes:
        rows: which rows of table I, as `drs reproduce` names them, and PandaReach; None for all with an agent.
        methods: names of the methods.
        seeds: tuning seeds, from 0 on.
        rollouts: after so many a search that has not reached its goal ends.
        agents: folder in the zoo's layout.
        output: folder of all records.
        hours: time for all; None for as long as it takes.
        workers: processes, each with a search of its own.
        backend: what runs episodes, where it can.
    """

    rows: str | None = None
    methods: tuple[str, ...] = ("paper", "frugal")
    seeds: int = 5
    rollouts: int = 5120
    agents: Path | None = None
    output: Path = Path("runs/sample_cost")
    hours: float | None = None
    workers: int = 1
    backend: str = "python"

    def __post_init__(self) -> None:
        """Raise UsageError with the value and what is allowed."""
        for name, least, most in (("seeds", 1, MAX_SEEDS), ("rollouts", 2, MAX_ROLLOUTS), ("workers", 1, 256)):
            value = getattr(self, name)
            if not least <= value <= most:
                raise UsageError(f"{name} is {value}; allowed are {least} to {most}.")
        if self.hours is not None and not (math.isfinite(self.hours) and self.hours > 0):
            raise UsageError(f"hours is {self.hours}; allowed are finite numbers above 0.")
        if self.agents is not None and not self.agents.is_dir():
            raise UsageError(f"There is no folder {self.agents}; check --agents.")
        for name, entry in chosen(self.methods).items():
            if self.rollouts < entry.first:
                raise UsageError(
                    f"rollouts is {self.rollouts}, and the first update of {name} takes {entry.first}; "
                    f"give at least as many, or leave {name} out."
                )
        check_backend(self.backend)
