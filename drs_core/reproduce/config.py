"""What is reproduced, and how much of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from drs_core.accelerator import check_backend
from drs_core.errors import UsageError
from drs_core.evaluation import check_seeds
from drs_core.objective import Objective
from drs_core.reproduce.paper import table
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig

EVALUATE_EVERY = 10
"""Updates between evaluations in a run, and of a row's turn where rows share the time."""
EVALUATION_EPISODES = 50


@dataclass(frozen=True)
class ReproduceConfig:
    """Settings of a reproduction; the search's own are the paper's.

    Attributes:
        table: I, II, III or IV.
        rows: which, as in `selection`; None for all.
        agents: folder in the zoo's layout.
        output: folder of all rows, shared by all tables.
        updates: run at most so many of the schedule's updates.
        patience: end a run whose evaluation has not risen for so many updates; 0 for never.
        seed: of the search.
        hours: time for all rows together; None for as long as it takes.
        workers: worker processes; 0 for none.
        backend: what runs episodes, where it can.
        episodes: of an evaluation; None for the paper's.
    """

    table: str
    rows: str | None = None
    agents: Path | None = None
    output: Path = Path("runs/reproduce")
    updates: int = SearchConfig.updates
    patience: int = 0
    seed: int = 0
    hours: float | None = None
    workers: int = 1
    backend: str = "python"
    episodes: int | None = None

    def __post_init__(self) -> None:
        """Raise UsageError with the value and what is allowed."""
        table(self.table)
        most = SearchConfig.updates
        if not 1 <= self.updates <= most:
            raise UsageError(f"updates is {self.updates}; allowed are 1 to {most}, the paper's schedule.")
        if not 0 <= self.patience <= most:
            raise UsageError(f"patience is {self.patience}; allowed are 0 to {most} updates.")
        if self.hours is not None and not (math.isfinite(self.hours) and self.hours > 0):
            raise UsageError(f"hours is {self.hours}; allowed are finite numbers above 0.")
        if self.episodes is not None and self.episodes < 2:
            raise UsageError(f"episodes is {self.episodes}; an interval needs 2 or more.")
        check_seeds(self.trials, 0)
        check_backend(self.backend)
        self.tuning(self.backend)
        if self.agents is not None and not self.agents.is_dir():
            raise UsageError(f"There is no folder {self.agents}; check --agents.")

    @property
    def trials(self) -> int:
        """Episodes of each evaluation, on seeds from 0 on."""
        return self.episodes if self.episodes is not None else table(self.table).episodes

    @property
    def objective(self) -> str:
        """What the table's agents are tuned for."""
        return table(self.table).objective

    def tuning(self, backend: str) -> TuneConfig:
        """The settings of a row's run."""
        return TuneConfig(
            SearchConfig(seed=self.seed), Objective(self.objective), EVALUATE_EVERY, EVALUATION_EPISODES, backend
        )
