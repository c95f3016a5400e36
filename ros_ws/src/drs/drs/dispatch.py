"""Which simulator gets which tasks, as pure functions."""

from __future__ import annotations

import math
from collections.abc import Sequence

CALL_S = 0.5
"""How long a batch should last: long beside the round trip, short beside an update."""
IN_FLIGHT = 2
"""Batches at one simulator: the next one waits beside it, so that it never idles."""
SILENT_S = 4.0
"""After it a simulator that owes a quick answer is asked by other means; Fast DDS repairs a loss in less."""
_LATE_FACTOR, _LATE_MARGIN_S = 2.0, 1.0
_REPEAT_S = 1.0


def batch_size(waiting: int, simulators: int, episode_s: float | None) -> int:
    """Tasks of the next batch for a simulator whose episodes take episode_s.

    It lasts about CALL_S, and towards the end less, so that all simulators end together. A
    simulator that has not shown its speed begins with one.
    """
    if episode_s is None:
        return min(1, waiting)
    fair = math.ceil(waiting / (IN_FLIGHT * max(simulators, 1)))
    return max(1, min(fair, int(CALL_S / max(episode_s, 1e-6)))) if waiting else 0


def is_late(age_s: float, expected_s: float) -> bool:
    """Whether an idle simulator should run again what another has had for age_s."""
    return age_s > _LATE_FACTOR * expected_s + _LATE_MARGIN_S


def is_due(ages_s: Sequence[float]) -> bool:
    """Whether a request that may arrive twice is sent (again), after those sent ages_s ago without an answer.

    Again after 1, 2, 4, ... s. The answer to a simulator's first request is lost where it does not know the
    tuner's end of the answers yet, and where a network loses a packet without another one behind it, Fast DDS
    notices after 3 s.
    """
    return min(ages_s, default=math.inf) > _REPEAT_S * 2.0 ** (len(ages_s) - 1)


def unfinished(tasks: Sequence[int], finished: Sequence[object | None]) -> list[int]:
    """Those tasks without a result."""
    return [task for task in tasks if finished[task] is None]
