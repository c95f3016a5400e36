"""The points of the figure: throughput by the model, for every agent, number of directions and of simulators."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from drs_core.files import write_atomically
from scripts.growth.costs import Costs
from scripts.growth.episodes import draw
from scripts.growth.model import simulate
from scripts.growth.rules import Rules

DIRECTIONS = (16, 128, 1024)
SIMULATORS = tuple(2**power for power in range(13))
LATENCIES_S = (0.0002, 0.02)
NEAR = LATENCIES_S[0]
TUNERS = ("as it is", "looks at one simulator", "waits for one client", "copies nothing")
"""The second looks, in a turn, only at the simulator that answered; the third's executor does so too.

The fourth, besides, asks nobody to run again what another one is late with.
"""
AS_IT_IS, ONE_LINK, ONE_CLIENT, NO_COPIES = TUNERS
_UPDATES = 4


@dataclass(frozen=True)
class Point:
    """One point: a case, and what the model says of it.

    Attributes:
        agent: whose episodes.
        tuner: one of TUNERS.
        latency_s: of a message [s].
        directions: of an update; it has twice as many rollouts.
        simulators: how many.
        rollouts_per_second: what they give together.
        ideal: simulators / mean duration of an episode [1/s].
        tuner_busy: share of the time in which the tuner works.
        copies: episodes sent twice, of all.
    """

    agent: str
    tuner: str
    latency_s: float
    directions: int
    simulators: int
    rollouts_per_second: float
    ideal: float
    tuner_busy: float
    copies: float


def costs_of(tuner: str, costs: Costs) -> Costs:
    """The costs that one of TUNERS would have."""
    if tuner != AS_IT_IS:
        costs = replace(costs, turn_s=costs.turn_s + costs.turn_link_s, turn_link_s=0.0, scan_call_s=0.0)
    if tuner in (ONE_CLIENT, NO_COPIES):
        costs = replace(costs, wake_s=costs.wake_s + costs.wake_link_s, wake_link_s=0.0)
    return costs


def rules_of(tuner: str, rules: Rules) -> Rules:
    """The rules that one of TUNERS would have."""
    return replace(rules, is_late=lambda age_s, expected_s: False) if tuner == NO_COPIES else rules


def point(
    agent: str, pairs: Sequence[tuple[float, ...]], costs: Costs, rules: Rules, tuner: str, latency_s: float,
    directions: int, simulators: int, seed: int = 0,
) -> Point:  # fmt: skip
    """One case; the same durations for every number of simulators."""
    updates = draw(pairs, directions, _UPDATES, seed)
    outcome = simulate(updates, simulators, costs_of(tuner, costs), rules_of(tuner, rules), latency_s)
    later = [duration for update in updates[1:] for duration in update]
    return Point(
        agent, tuner, latency_s, directions, simulators,
        rollouts_per_second=_digits(outcome.rollouts_per_second()),
        ideal=_digits(simulators * len(later) / sum(later)),
        tuner_busy=_digits(outcome.tuner_s / outcome.ends_s[-1]),
        copies=_digits(outcome.copies / sum(map(len, updates))),
    )  # fmt: skip


def sweep(
    costs: dict[str, Costs], episodes: dict[str, list[tuple[float, ...]]], rules: Rules,
    simulators: Sequence[int] = SIMULATORS,
) -> list[Point]:  # fmt: skip
    """Every point of the figure and of the page."""
    return [
        point(agent, episodes[agent], costs[agent], rules, tuner, latency_s, directions, count)
        for agent in costs
        for tuner in TUNERS
        for latency_s in (LATENCIES_S if tuner == AS_IT_IS else (NEAR,))
        for directions in DIRECTIONS
        for count in simulators
    ]


def save_points(path: Path, points: Sequence[Point]) -> None:
    """Write a line a point."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Point)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(one) for one in points)
    write_atomically(path, text.getvalue().encode())


def load_points(path: Path) -> list[Point]:
    """What save_points wrote."""
    kinds = {"agent": str, "tuner": str, "directions": int, "simulators": int}
    with open(path, newline="") as file:
        return [
            Point(**{key: kinds.get(key, float)(text) for key, text in row.items()}) for row in csv.DictReader(file)
        ]


def _digits(value: float) -> float:
    return float(f"{value:.4g}")
