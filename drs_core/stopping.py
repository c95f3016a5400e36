"""When a run has gone flat: decided from its evaluations alone, so that a resumed run decides the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class FlatRule:
    """How little counts as nothing, and how sure the rule has to be; measured in docs/results/flat_stops.md.

    Attributes:
        share: of the gain so far, or of the baseline's spread from episode to episode if that is more: nothing.
        errors: standard errors by which it must hold.
        least: evaluations before the rule may fire, the one before the first update with them; 6 or more.
    """

    share: float = 0.1
    errors: float = 1.0
    least: int = 15

    def check(self, updates: int, evaluate_every: int, episodes: int) -> None:
        """Raise UsageError where a run of these settings gives the rule too little to go by."""
        evaluations = updates // evaluate_every + 1 if evaluate_every else 0
        if evaluations <= self.least:
            raise UsageError(
                f"stop_when_flat ends a run after {self.least} evaluations at the earliest, but evaluate_every "
                f"{evaluate_every} gives {evaluations} in {updates} updates: evaluate more often."
            )
        if episodes < 2:
            raise UsageError(f"stop_when_flat needs evaluation_episodes of 2 or more, not {episodes}.")


RULE = FlatRule()


@dataclass(frozen=True)
class Flat:
    """Why a run has gone flat.

    Attributes:
        update: of the newest evaluation.
        newer, older: updates of the first evaluations of the last and of the middle third.
        most: what the last third can have added, its standard errors with it; in units of the objective.
        allowed: up to what that counts as nothing.
    """

    update: int
    newer: int
    older: int
    most: float
    allowed: float

    def sentence(self) -> str:
        """The same for people."""
        return (
            f"Flat after update {self.update}: no evaluation from update {self.newer} on is the best, and with its "
            f"error their mean objective is at most {self.most:.3g} above that from update {self.older} on, where up "
            f"to {self.allowed:.3g} counts as nothing."
        )


def flat(records: Sequence[Mapping[str, Any]], rule: FlatRule = RULE) -> Flat | None:
    """Whether the evaluations until now show that a run has gone flat; None where they do not.

    The last third of the evaluations is compared with the third before it. Their mean difference has two
    errors: over episodes (the same ones in every evaluation, so they are paired) and over evaluations (theta
    hovers). The run is flat where the difference and `errors` times both is no more than counts as nothing,
    and the best evaluation, whose agent a run delivers, is older than the last third. Thirds, since a window
    of fixed length calls every slow run flat; their means, since the best of several evaluations is mostly
    the luckiest.

    Args:
        records: of evaluations.jsonl in order; those without `objectives` (older versions) are passed over.
        rule: the constants.

    Raises:
        UsageError: objectives are not as many finite numbers in every record.
    """
    judged = [record for record in records if "objectives" in record]
    if len(judged) < rule.least:
        return None
    objectives, third = _matrix(judged), len(judged) // 3
    with np.errstate(over="ignore", invalid="ignore"):
        most, allowed = _last_against_middle(objectives, third, rule)
        best_is_new = int(objectives.mean(axis=1).argmax()) >= len(judged) - third
    # the comparison is also false where numbers are too large for a variance
    if best_is_new or not most <= allowed:
        return None
    updates = [int(record["update"]) for record in judged]
    return Flat(updates[-1], updates[-third], updates[-2 * third], most, allowed)


def _last_against_middle(objectives: Float64, third: int, rule: FlatRule) -> tuple[float, float]:
    """What the last third can have added, and what counts as nothing."""
    first, middle, last = objectives[0], objectives[-2 * third : -third], objectives[-third:]
    paired = last.mean(axis=0) - middle.mean(axis=0)
    hovering = last.mean(axis=1).var(ddof=1) + middle.mean(axis=1).var(ddof=1)
    error = np.sqrt(paired.var(ddof=1) / len(paired) + hovering / third)
    gain = last.mean() - first.mean()
    return float(paired.mean() + rule.errors * error), float(rule.share * max(gain, first.std()))


def _matrix(records: Sequence[Mapping[str, Any]]) -> Float64:
    """(evaluations, episodes) float64."""
    try:
        objectives = np.array([record["objectives"] for record in records], dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise UsageError("The objectives of evaluations.jsonl are not as many numbers in every line.") from error
    if objectives.ndim != 2 or objectives.shape[1] < 2 or not np.isfinite(objectives).all():
        raise UsageError("The objectives of evaluations.jsonl are not two or more finite numbers in every line.")
    return objectives
