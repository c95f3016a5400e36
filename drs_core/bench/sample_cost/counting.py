"""Which of a search's records count for a budget: the same, however far other budgets have brought it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drs_core.bench.sample_cost.looks import due
from drs_core.bench.sample_cost.records import COUNTER, Record


@dataclass(frozen=True)
class Within:
    """What counts.

    Attributes:
        looks: those that count, in order, the last of an ended search being its result.
        missing: after how many rollouts a look would count that is not there; None where all are.
        done: rollouts that these looks have seen, or that are done where none is missing.
        ended: whether the goal is reached, or the budget spent and looked at.
    """

    looks: list[Record]
    missing: int | None
    done: int
    ended: bool


def within(records: Sequence[Record], most: int) -> Within:
    """What counts of these records for a budget of `most` rollouts.

    A budget ends where another update, as long as the first, would go beyond it. Looks count that are due, and
    the one at this end. One at the end of another budget moves none that is due and ends no larger search: what
    a budget tells must not depend on which others were asked before.
    """
    looks = {record[COUNTER]: record for record in records if "reached" in record}
    places = [0, *(record[COUNTER] for record in records if "objectives" in record)]
    counting, looked, first = list[Record](), -1, places[1:2]
    for done in places:
        last = bool(first) and done + first[0] > most
        if due(looked, done) or last:
            if done not in looks:
                return Within(counting, done, done, False)
            counting.append(looks[done])
            if last or looks[done]["reached"]:
                return Within(counting, None, done, True)
            looked = done
    return Within(counting, None, places[-1], False)


def ended(records: Sequence[Record], most: int) -> bool:
    """Whether within `most` rollouts the goal is reached, or all of them are spent and looked at."""
    return within(records, most).ended
