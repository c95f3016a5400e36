"""When a search is looked at from outside, and with which episodes; they are not counted as its rollouts."""

from __future__ import annotations

from drs_core.bench.sample_cost.goal import Goal
from drs_core.bench.sample_cost.records import COUNTER, Record
from drs_core.policy import Float32
from drs_core.rollouts import Rollouts, Task
from drs_core.search import evaluation_seeds

EPISODES = 100
FIRST = 20
"""Of an evaluation's episodes, after which a hopeless one ends."""
_SPACING = 1.25
_LEAST = 32


def due(looked: int, done: int) -> bool:
    """Whether to look after `done` rollouts, the last look having been after `looked` (-1 for none).

    Every 32 rollouts at first, later whenever there are a quarter more: the answer is too large by a quarter
    at most, and looking costs no more than the search.
    """
    return looked < 0 or done >= max(looked + _LEAST, _SPACING * looked)


def look_seeds(run_seed: int, done: int) -> list[int]:
    """Episode seeds of a look, apart from those of the search's rollouts and of every other look.

    Those of the one at 0, of the start, are also the evaluation seeds of the run.
    """
    return evaluation_seeds(run_seed ^ (done << 32), EPISODES)


def look(rollouts: Rollouts, goal: Goal, theta: Float32, run_seed: int, done: int) -> Record:
    """What theta (d,) is worth after `done` rollouts; nothing else decides the result."""
    tasks = [Task(seed, goal.measure) for seed in look_seeds(run_seed, done)]
    episodes = rollouts.run(theta, tasks[:FIRST])
    if not goal.out_of_reach(episodes):
        episodes += rollouts.run(theta, tasks[FIRST:])
    return {
        COUNTER: done,
        "reached": len(episodes) == EPISODES and goal.reached(episodes),
        "shown": goal.shown(episodes),
        "returns": [episode.return_ for episode in episodes],
    }
