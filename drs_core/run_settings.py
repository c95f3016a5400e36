"""What a run is asked to be: from parameters by name, as options, parameter files and nodes give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drs_core.budget import Budget, budget_from, parse_duration, plan
from drs_core.environments import timing
from drs_core.errors import UsageError
from drs_core.node_parameters import is_of_a_node
from drs_core.parameters import read_parameters
from drs_core.tune_config import TuneConfig, tune_config


@dataclass(frozen=True)
class RunSettings:
    """One run.

    Attributes:
        config: what decides its result; with a budget `updates` is yet to come.
        budget: the robot time that there is; None: `updates` says it.
        stop_when_flat: whether it may end before its last update.
        observations: recording that the cap of the action change is judged on; empty for none.
    """

    config: TuneConfig
    budget: Budget | None = None
    stop_when_flat: bool = False
    observations: str = ""

    def planned(self, environment_id: str) -> tuple[TuneConfig, str]:
        """The configuration for an environment, and a sentence on what the budget comes to; empty without one.

        Raises:
            UsageError: the budget is too small, or the environment states no rate.
            DrsError: the package that it needs is not installed.
        """
        if self.budget is None:
            return self.config, ""
        found = plan(self.budget, timing(environment_id), self.config)
        return found.config, found.sentence()


def run_settings(values: Mapping[str, Any]) -> RunSettings:
    """Settings from parameters by name; a budget that is not empty takes the place of `updates`.

    Raises:
        UsageError: a value is out of range.
    """
    stop_when_flat, observations = values.get("stop_when_flat", False), values.get("observations", "")
    return RunSettings(tune_config(values), budget_from(values), stop_when_flat, observations)


def read_run_settings(params: Path | None, options: Mapping[str, Any]) -> RunSettings:
    """Settings from a parameter file, if any, and from options, which win over it.

    Raises:
        UsageError: a value is out of range, the file is none, or options contradict each other.
    """
    values = read_parameters(params, elsewhere=is_of_a_node) if params is not None else {}
    try:
        run_settings(values)
    except UsageError as error:
        raise UsageError(f"{params}: {error}") from error
    if "budget" in options:
        # an empty one is none in a file, but a mistake here
        parse_duration(options["budget"])
        if "updates" in options:
            raise UsageError(
                f"--budget {options['budget']} says how many updates, and so does --updates {options['updates']}: "
                "give one of them."
            )
    elif "updates" in options:
        values["budget"] = ""
    settings = run_settings({**values, **options})
    if "reset_seconds" in options and settings.budget is None:
        raise UsageError(
            f"--reset-seconds {options['reset_seconds']:g} counts against a budget, and there is none; give --budget."
        )
    return settings
