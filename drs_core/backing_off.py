"""Back to the best agent, with more careful steps, where a search is lost: its episodes are worse than they were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from drs_core.errors import UsageError
from drs_core.search import SearchConfig

WINDOW = 20
"""Updates that are judged together; those before the newest going back are not."""
LOST = 0.5
"""Standard deviations from episode to episode by which they must be worse; docs/results/frugal.md has what it does."""
MOST = 2
KEY = "backed_off"
"""In the record of the first update after going back: how often that was so far."""
_AGAIN = "start_again_"
"""Before the names of figures in the record of the update before which the start was evaluated again."""
_FIGURES = ("objective_mean", "objective_std")


def check(back_off: bool, evaluate_every: int) -> None:
    """Raise UsageError where a run of these settings has no best agent to go back to."""
    if back_off and not evaluate_every:
        raise UsageError("back_off goes back to the best agent of the evaluations, but evaluate_every is 0: evaluate.")


def check_records(
    updates: Sequence[Mapping[str, Any]], evaluations: Sequence[Mapping[str, Any]], done: int, every: int
) -> None:
    """Raise UsageError unless the records of a run are whole: they decide when it goes back, and so theta.

    Args:
        updates: records of history.jsonl.
        evaluations: of evaluations.jsonl.
        done: updates that the run has done.
        every: updates from one evaluation to the next.
    """
    mend = "back_off decides by it: put the right file back or choose a new folder."
    if [record["update"] for record in updates] != list(range(1, done + 1)):
        raise UsageError(f"The run's history.jsonl does not hold each of its {done} updates once, and {mend}")
    if [record["update"] for record in evaluations if record["update"] < done] != list(range(0, done, every)):
        raise UsageError(
            f"The run's evaluations.jsonl does not hold each evaluation of its {done} updates once, and {mend}"
        )
    again = [_AGAIN + name for name in _FIGURES]
    for name, records in (("history.jsonl", updates), ("evaluations.jsonl", evaluations)):
        for record in records:
            for figure in (*_FIGURES, *(again if again[0] in record else ())):
                # what is not finite is no JSON
                if not isinstance(record.get(figure), float):
                    raise UsageError(f"{figure} of update {record['update']} in {name} is not a number, and {mend}")
    backed = [record[KEY] for record in updates if KEY in record]
    if backed != list(range(1, len(backed) + 1)) or len(backed) > MOST:
        raise UsageError(f"{KEY} in the run's history.jsonl is {str(backed)[:80]}, not 1 to {MOST}, and {mend}")


def times(updates: Sequence[Mapping[str, Any]]) -> int:
    """How often a run has gone back, from its records in history.jsonl."""
    return max((int(record[KEY]) for record in updates if KEY in record), default=0)


def places(updates: Sequence[Mapping[str, Any]]) -> list[int]:
    """The first update after each going back."""
    return [record["update"] for record in updates if KEY in record]


def start_again(updates: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Figures of the agent that the run began with, on fresh episodes; None before they were needed."""
    names = {name: _AGAIN + name for name in _FIGURES}
    for record in updates:
        if all(kept in record for kept in names.values()):
            return {name: record[kept] for name, kept in names.items()}
    return None


def kept(start: Mapping[str, float]) -> dict[str, float]:
    """Such figures for the record of an update."""
    return {_AGAIN + name: start[name] for name in _FIGURES}


def is_lost(updates: Sequence[Mapping[str, Any]], start: Mapping[str, Any]) -> bool:
    """Whether the newest updates' episodes are clearly worse than others.

    Others are those of the agent that the run began with, and those of any as many updates that follow each
    other, before these and after the newest going back.

    They are worse where their mean objective is lower by more than LOST standard deviations: of the other
    episodes or of the newest updates' own, whichever is more, since a few episodes of an agent that seldom fails
    may show no failure. Without any spread it is not said.

    Where the first evaluation says so, its luck may have: the start is evaluated again, on fresh episodes, and
    from there on those are what is compared with.

    Args:
        updates: records of history.jsonl, in order.
        start: the first record of evaluations.jsonl, or `start_again`.
    """
    begins = max((place for place, record in enumerate(updates) if KEY in record), default=0)
    here = updates[begins:]
    if len(here) < WINDOW or times(updates) >= MOST:
        return False
    # what is too large for a mean or a spread is not judged
    with np.errstate(over="ignore", invalid="ignore"):
        windows = _windows(here)
        mean, spread = windows[-1]
        # of the rest those that share no update with the newest
        others = [(start["objective_mean"], start["objective_std"]), *windows[:-WINDOW]]
        return any(bool(other - mean > LOST * max(own, spread) > 0.0) for other, own in others)


def _windows(updates: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Mean and standard deviation within updates, of every WINDOW updates that follow each other; there are as many."""
    means = np.array([record["objective_mean"] for record in updates])
    variances = np.square([record["objective_std"] for record in updates])
    mean, variance = (sliding_window_view(values, WINDOW).mean(axis=1) for values in (means, variances))
    return list(zip(mean.tolist(), np.sqrt(variance).tolist(), strict=True))


def more_careful(search: SearchConfig, times: int) -> SearchConfig:
    """The search as it goes on after going back so often.

    Each time half of alpha, and all directions count: an agent that seldom fails learns from the pairs of which
    one side fails, and the better directions are hardly among those. If it is lost once more, it is the
    perturbations that make the episodes worse: a quarter of sigma.
    """
    if not times:
        return search
    sigma = _part_of(0.25, search.sigma) if times > 1 else search.sigma
    return replace(search, alpha=_part_of(0.5**times, search.alpha), sigma=sigma, top=0)


def _part_of(part: float, ends: tuple[float, float]) -> tuple[float, float]:
    first, last = ends
    return part * first, part * last


def said(record: Mapping[str, Any]) -> str:
    """What to tell with the record of an update; empty unless it is the first after going back."""
    if KEY not in record:
        return ""
    return (
        f"before update {record['update']}: episodes of the search are clearly worse than they were; "
        f"back to the best agent, with alpha {record['alpha']:.2g} and sigma {record['sigma']:.2g}"
    )
