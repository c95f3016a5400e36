"""A budget of robot time as a number of updates: everything counts that a run does."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from drs_core.backing_off import WINDOW
from drs_core.environments import Timing
from drs_core.errors import UsageError, shown
from drs_core.objective import BASELINE_EPISODES
from drs_core.search import MAX_UPDATES
from drs_core.tune_config import TuneConfig

LEAST_S, MOST_S = 1.0, 3.6e7
MOST_RESET_S = 3600.0

_NUMBER = r"([0-9]{1,9}(?:\.[0-9]{1,9})?)"
_DURATION = re.compile(rf"(?:{_NUMBER} ?h)? ?(?:{_NUMBER} ?min)? ?(?:{_NUMBER} ?s)?")
_ROUNDING = 1e-9


def parse_duration(text: str) -> float:
    """Seconds of a duration such as ``90s``, ``20min``, ``1h`` or ``1h30min``.

    Raises:
        UsageError: it is none, or shorter than a second or longer than 10000 hours.
    """
    found = _DURATION.fullmatch(text.strip()) if len(text) <= 60 else None
    if found is None or not any(found.groups()):
        raise UsageError(f"The budget {shown(text)} is no duration; write one as in 90s, 20min, 1h or 1h30min.")
    hours, minutes, seconds = (float(part or 0.0) for part in found.groups())
    duration_s = 3600.0 * hours + 60.0 * minutes + seconds
    if not LEAST_S <= duration_s <= MOST_S:
        raise UsageError(f"The budget {shown(text)} is out of range; allowed are 1s to 10000h.")
    return duration_s


def duration(duration_s: float) -> str:
    """The same in words, up to the next whole second: 5400 -> ``1h30min``."""
    whole = math.ceil(duration_s - _ROUNDING)
    parts = ((whole // 3600, "h"), (whole // 60 % 60, "min"), (whole % 60, "s"))
    return "".join(f"{count}{unit}" for count, unit in parts if count) or "0s"


@dataclass(frozen=True)
class Budget:
    """Robot time for one run.

    Attributes:
        time_s: all of it [s].
        reset_s: time between two episodes [s].
    """

    time_s: float
    reset_s: float = 0.0

    def __post_init__(self) -> None:
        """Raise UsageError for a reset time that is out of range."""
        if not 0.0 <= self.reset_s <= MOST_RESET_S:
            raise UsageError(f"reset_seconds is {self.reset_s}; allowed are 0 to {MOST_RESET_S:g}.")


def budget_from(values: Mapping[str, Any]) -> Budget | None:
    """The budget among parameters by name; None where `budget` is empty or missing.

    Raises:
        UsageError: it is no duration, or the time between episodes is out of range.
    """
    text = values.get("budget")
    return Budget(parse_duration(text), values.get("reset_seconds", 0.0)) if text else None


@dataclass(frozen=True)
class Plan:
    """What a budget comes to.

    Attributes:
        budget: the time that there is.
        clock: of the environment.
        config: settings of the run, `updates` those that the budget pays for.
    """

    budget: Budget
    clock: Timing
    config: TuneConfig

    @property
    def episodes(self) -> int:
        """Episodes of the whole run, at most."""
        return _episodes(self.config, self.config.search.updates)

    def sentence(self) -> str:
        """What the budget comes to, for people."""
        config, clock, reset_s = self.config, self.clock, self.budget.reset_s
        search, evaluations = config.search, _evaluations(config, config.search.updates)
        again = _may_back_off(config, search.updates)
        parts = [
            f"{_count(search.updates, 'update')} of 2 x {search.directions} episodes",
            *([f"{_count(evaluations, 'evaluation')} of {config.evaluation_episodes}"] if evaluations else []),
            *([f"{BASELINE_EPISODES} of the baseline"] if config.objective.needs_baseline else []),
            *([f"{BASELINE_EPISODES} of the start again, should the search look lost"] if again else []),
        ]
        between = f" and {reset_s:g} s between them" if reset_s else ""
        return (
            f"A budget of {duration(self.budget.time_s)} pays for {', '.join(parts)}: {self.episodes} episodes of at "
            f"most {clock}{between}, "
            f"{duration(self.episodes * (clock.episode_s + reset_s))}."
        )


def plan(budget: Budget, clock: Timing, config: TuneConfig) -> Plan:
    """The run of the most updates that a budget pays for, an episode taken at its longest; `updates` is set anew.

    Raises:
        UsageError: it is too small for one update.
    """
    each_s = clock.episode_s + budget.reset_s
    episodes, needed = int(budget.time_s / each_s + _ROUNDING), _episodes(config, 1)
    if episodes < needed:
        raise UsageError(
            f"A budget of {duration(budget.time_s)} is too small for one update, which takes {needed} episodes of "
            f"{each_s:.3g} s with all that a run does: give at least {duration(needed * each_s)}, or fewer directions "
            "or evaluation episodes."
        )
    left = episodes - _episodes(config, 0)
    updates = _updates(config, left)
    if _may_back_off(config, updates):
        updates = max(WINDOW, _updates(config, left - BASELINE_EPISODES))
    if updates > MAX_UPDATES:
        raise UsageError(
            f"A budget of {duration(budget.time_s)} pays for {updates} updates, and {MAX_UPDATES} are the most of a "
            f"run: give at most {duration(_episodes(config, MAX_UPDATES) * each_s)}, or more directions."
        )
    return Plan(budget, clock, replace(config, search=replace(config.search, updates=updates)))


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


def _may_back_off(config: TuneConfig, updates: int) -> bool:
    """Whether a run of so many updates may begin its start's episodes anew; it is judged by WINDOW of them."""
    return config.back_off and updates > WINDOW


def _updates(config: TuneConfig, left: int) -> int:
    """Updates, with the evaluations among them, for which `left` episodes are enough."""
    rollouts, every = 2 * config.search.directions, config.evaluate_every
    if not every:
        return left // rollouts
    cycles, rest = divmod(left, every * rollouts + config.evaluation_episodes)
    return cycles * every + min(rest // rollouts, every - 1)


def _evaluations(config: TuneConfig, updates: int) -> int:
    """Evaluations of a run, the one before its first update with them."""
    return updates // config.evaluate_every + 1 if config.evaluate_every else 0


def _episodes(config: TuneConfig, updates: int) -> int:
    """Episodes of a run of so many updates, at most."""
    baseline = BASELINE_EPISODES * (config.objective.needs_baseline + _may_back_off(config, updates))
    rollouts = 2 * config.search.directions * updates
    return baseline + rollouts + _evaluations(config, updates) * config.evaluation_episodes
