"""Medians over rounds, and ratios formed round by round. Pure functions of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from drs_core.bench.sample import Sample

ROLLOUTS = 128
"""Of an update with the paper's 64 directions."""


@dataclass(frozen=True)
class Spread:
    """Median, least and greatest value over rounds."""

    median: float
    low: float
    high: float


def spread(values: Sequence[float]) -> Spread:
    """Of one or more values."""
    return Spread(median(values), min(values), max(values))


def ratio(over: Sequence[float], under: Sequence[float]) -> Spread:
    """Over / under, formed within each round, so that what slows a whole round cancels."""
    return spread([a / b for a, b in zip(over, under, strict=True)])


def variant_summary(samples: Sequence[Sample], episode_steps: float) -> dict[str, Any]:
    """What a variant costs.

    Args:
        samples: one a round.
        episode_steps: mean length of the agent's episodes, the same for all variants.
    """
    cpu = [sample.cpu_us_per_step for sample in samples]
    wall = [sample.wall_us_per_step * 1e-6 * episode_steps * ROLLOUTS for sample in samples]
    return {
        "cpu_us_per_step": median(cpu),
        "wall_s_per_128_rollouts": median(wall),
        "cores_used": median([sample.cpu_s / sample.wall_s for sample in samples]),
        "steps": sum(sample.steps for sample in samples),
        "rollouts": sum(sample.rollouts for sample in samples),
        "cpu_us_per_step_rounds": cpu,
        "wall_s_per_128_rollouts_rounds": wall,
    }


def ratios(samples: Mapping[str, Sequence[Sample]], pairs: Sequence[tuple[str, str]]) -> dict[str, dict[str, float]]:
    """``over/under`` -> median, low and high of the CPU time of a step, for the pairs that were measured."""
    cpu = {name: [sample.cpu_us_per_step for sample in rounds] for name, rounds in samples.items()}
    return {
        f"{over}/{under}": asdict(ratio(cpu[over], cpu[under])) for over, under in pairs if over in cpu and under in cpu
    }


def throughput(faster: Sequence[Sample], slower: Sequence[Sample]) -> dict[str, float]:
    """How many times the steps a second of wall time, median, low and high."""
    return asdict(ratio([s.wall_us_per_step for s in slower], [s.wall_us_per_step for s in faster]))
