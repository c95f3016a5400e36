"""Monte-Carlo evaluation of an agent, and the paired comparison of two."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.agent import Agent
from drs_core.episode import DIMENSION, MOTION, Episode
from drs_core.errors import UsageError
from drs_core.measures.statistics import mean_interval, percent_interval, resampled_means
from drs_core.rollouts import ATTEMPTS, Progress, Rollouts, Task, check_enough, run_groups

Value = Callable[[Episode], float]

MAX_EPISODES = 1_000_000
MEASURES = frozenset({DIMENSION, MOTION})


@dataclass(frozen=True)
class Evaluation:
    """Episodes of one agent on the seeds seed, seed + 1, …, and how long they took.

    Attributes:
        name, environment: of the agent.
        seed: of the first episode.
        episodes: the finished ones.
        wall_s: how long all took.
        unfinished: how many were broken off again and again, and count nowhere.
    """

    name: str
    environment: str
    seed: int
    episodes: list[Episode]
    wall_s: float
    unfinished: int = 0

    def column(self, value: Value) -> NDArray[np.float64]:
        """One number of every episode, (episodes,) float64."""
        return np.array([value(episode) for episode in self.episodes], dtype=np.float64)

    @property
    def returns(self) -> NDArray[np.float64]:
        """(episodes,) float64."""
        return self.column(lambda episode: episode.return_)


def check_seeds(episodes: int, seed: int) -> None:
    """Raise UsageError where the number of episodes or the first seed is out of range."""
    if not 1 <= episodes <= MAX_EPISODES:
        raise UsageError(f"episodes is {episodes}; allowed are 1 to {MAX_EPISODES}.")
    if not 0 <= seed < 2**63 - MAX_EPISODES:
        raise UsageError(f"seed is {seed}; allowed are 0 to 2^63 - {MAX_EPISODES}.")


def evaluate(
    name: str,
    agent: Agent,
    rollouts: Rollouts,
    episodes: int,
    seed: int,
    progress: Progress | None = None,
    attempts: int = ATTEMPTS,
) -> Evaluation:
    """Run the agent unperturbed on the seeds seed .. seed + episodes - 1, each `attempts` times at most.

    Raises:
        UsageError: the number of episodes or the seed is out of range.
        DrsError: fewer than half of the episodes could be finished.
    """
    check_seeds(episodes, seed)
    start = time.perf_counter()
    tasks = [[Task(seed + i, MEASURES)] for i in range(episodes)]
    found = run_groups(rollouts, agent.theta, tasks, attempts, progress)
    check_enough(found, "episodes")
    done = [group.episodes[0] for group in found if group.finished]
    wall_s = time.perf_counter() - start
    return Evaluation(name, agent.environment, seed, done, wall_s, episodes - len(done))


def summary(evaluation: Evaluation) -> dict[str, Any]:
    """The keys of ``drs evaluate --json``; intervals are [low, high] at 95 %, None of the mean of one."""
    episodes, returns = evaluation.episodes, evaluation.returns
    n = len(episodes)
    lengths = evaluation.column(lambda episode: episode.length)
    measured = [episode.dimension for episode in episodes if episode.dimension is not None]
    dimensions = np.array([dimension.mean() for dimension in measured])
    bounds = np.array([dimension.bounds() for dimension in measured])
    failures = sum(episode.failed for episode in episodes)
    successes = [episode.success for episode in episodes if episode.success is not None]
    return {
        "agent": evaluation.name,
        "environment": evaluation.environment,
        "episodes": n,
        "seed": evaluation.seed,
        "return_mean": float(returns.mean()),
        "return_std": float(returns.std()),
        "return_ci95": _interval(returns),
        "length_mean": float(lengths.mean()),
        "failure_percent": 100.0 * failures / n,
        "failure_ci95": list(percent_interval(failures, n)),
        "success_percent": 100.0 * sum(successes) / n if successes else None,
        "success_ci95": list(percent_interval(sum(successes), n)) if successes else None,
        "dimension_mean": float(dimensions.mean()),
        "dimension_std": float(dimensions.std()),
        "dimension_ci95": _interval(dimensions),
        "dimension_lower_mean": float(bounds[:, 0].mean()),
        "dimension_upper_mean": float(bounds[:, 1].mean()),
        "action_change_mean": float(evaluation.column(lambda episode: episode.action_change).mean()),
        "rollouts_per_second": n / evaluation.wall_s,
        "steps_per_second": float(lengths.sum()) / evaluation.wall_s,
        **_motion(episodes),
    }


def _interval(values: NDArray[np.float64]) -> list[float] | None:
    # one value tells nothing of how others lie
    return list(mean_interval(values)) if len(values) > 1 else None


_MOTION_KEYS = {
    "tip_speed": ("tip_speed_mean", "speed_mean"),
    "tip_jerk": ("tip_jerk_mean_square", "jerk_mean_square"),
    "tip_position_std": ("tip_position_std", "position_std"),
    "velocity_sign_flips": ("velocity_sign_flips", "velocity_sign_flips"),
    "log_dimensionless_jerk": ("log_dimensionless_jerk", "log_dimensionless_jerk"),
}


def _motion(episodes: Sequence[Episode]) -> dict[str, Any]:
    motions = [episode.motion for episode in episodes if episode.motion is not None]
    if not motions:
        return {}
    result: dict[str, Any] = {}
    for stem, (key, attribute) in _MOTION_KEYS.items():
        values = np.array([getattr(motion, attribute) for motion in motions])
        result[key] = float(values.mean())
        result[f"{stem}_ci95"] = _interval(values)
    return result


def _motion_value(attribute: str) -> Value:
    return lambda episode: float(getattr(episode.motion, attribute))


# measure -> (value of an episode, +1 where more is better and -1 where less is)
_COMPARED: dict[str, tuple[Value, int]] = {
    "return": (lambda episode: episode.return_, 1),
    "action_change": (lambda episode: episode.action_change, -1),
}
_COMPARED_DIMENSION: dict[str, tuple[Value, int]] = {
    "dimension": (lambda episode: episode.dimension.mean() if episode.dimension else math.nan, -1),
}
_COMPARED_MOTION: dict[str, tuple[Value, int]] = {
    "tip_speed": (_motion_value("speed_mean"), -1),
    "tip_jerk": (_motion_value("jerk_mean_square"), -1),
    "tip_position_std": (_motion_value("position_std"), -1),
}


def comparison(before: Evaluation, after: Evaluation) -> dict[str, Any]:
    """Both summaries, and for each measure the paired difference on the same seeds.

    ``probability_after_better`` is the share of bootstrap resamples of the paired differences whose
    mean is better than 0 (half of those at 0), None of one episode; at the top level it is that of the return.

    Raises:
        UsageError: the two were not run in one environment on the same seeds.
    """
    seeds = [[episode.seed for episode in evaluation.episodes] for evaluation in (before, after)]
    if before.environment != after.environment or seeds[0] != seeds[1]:
        raise UsageError(
            f"{before.environment} and {after.environment} cannot be compared: "
            "take two agents of one environment and the same seeds."
        )
    episodes = before.episodes + after.episodes
    measures = _COMPARED | (_COMPARED_DIMENSION if all(episode.dimension for episode in episodes) else {})
    measures |= _COMPARED_MOTION if all(episode.motion for episode in episodes) else {}
    differences = {
        name: _paired(after.column(value) - before.column(value), sign) for name, (value, sign) in measures.items()
    }
    returns = after.returns - before.returns
    return {
        "before": summary(before),
        "after": summary(after),
        "differences": differences,
        "probability_after_better": differences["return"]["probability_after_better"],
        "episodes_better": int((returns > 0).sum()),
        "episodes_equal": int((returns == 0).sum()),
        "episodes_worse": int((returns < 0).sum()),
    }


def _paired(difference: NDArray[np.float64], sign: int) -> dict[str, Any]:
    means = sign * (resampled_means(difference) if np.ptp(difference) else difference[:1])
    probability = float((means > 0).mean() + 0.5 * (means == 0).mean())
    return {
        "mean": float(difference.mean()),
        "ci95": _interval(difference),
        "probability_after_better": probability if len(difference) > 1 else None,
    }


def typical_seed(evaluation: Evaluation, quantile: float = 0.5) -> int:
    """Seed of the episode that a figure should show: the median one, or of another quantile in [0, 1].

    Episodes stand in the order of the tip's speed in the goal region, or of the return where there is no tip.
    """
    moving = all(episode.motion is not None for episode in evaluation.episodes)
    order = np.argsort(evaluation.column(_motion_value("speed_mean")) if moving else evaluation.returns, kind="stable")
    return evaluation.episodes[int(order[min(int(quantile * len(order)), len(order) - 1)])].seed
