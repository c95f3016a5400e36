"""Which agent of a training is the best: by success, then by return, on seeds that nothing else uses."""

from __future__ import annotations

import math
from contextlib import closing
from typing import Any

from drs_core.agent import Agent
from drs_core.evaluation import evaluate, summary
from drs_core.rollouts import InProcess, Progress

EVALUATION_SEED = 1_000_000
"""Evaluation in training uses seeds of its own, so that seed 0 stays fresh."""
FIRST_LOOK_EPISODES = 10
_CLEARLY_WORSE_PERCENT = 20.0
_BEGINNER_PERCENT = 20.0

Result = dict[str, Any]


def judge(agent: Agent, best: Result | None, episodes: int, wanted: float | None, progress: Progress) -> Result:
    """The agent's summary over a first look, or over all `episodes` where it may be the best.

    Args:
        agent: to be judged.
        best: summary of the best so far, if any.
        episodes: of a whole evaluation.
        wanted: success in percent that ends the training; a first look that reaches it is not enough.
        progress: called after every episode.
    """

    def run(count: int) -> Result:
        return summary(evaluate("", agent, rollouts, count, EVALUATION_SEED, progress))

    with closing(InProcess(agent)) as rollouts:
        first = run(min(FIRST_LOOK_EPISODES, episodes))
        enough = wanted is not None and (first["success_percent"] or 0.0) >= wanted
        return run(episodes) if first["episodes"] < episodes and (enough or promising(first, best)) else first


def rank(evaluation: Result) -> tuple[int, float, float]:
    """All episodes count more than a first look; then success, then return."""
    return (evaluation["episodes"], evaluation["success_percent"] or 0.0, evaluation["return_mean"])


def promising(first: Result, best: Result | None) -> bool:
    """Whether a first look does not rule out that the agent is the best."""
    success, seen = first["success_percent"], first["episodes"]
    if success is not None and success < _BEGINNER_PERCENT:
        return False
    if best is None or best["episodes"] <= seen:
        return True
    if success is not None:
        return bool(success >= best["success_percent"] - _CLEARLY_WORSE_PERCENT)
    return bool(first["return_mean"] + 2.0 * first["return_std"] / math.sqrt(seen) >= best["return_mean"])
