"""Updates on real simulator nodes beside what the model says of the same episodes."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

from drs.bench_rollouts import fleet, simulators, wait_for
from drs.patience import Patience
from drs.run_node import SWITCH_INTERVAL_S
from drs.service_rollouts import ServiceRollouts
from drs.turns import Turns
from drs_core.agent import Agent
from drs_core.search import SearchConfig
from scripts.growth.costs import Costs
from scripts.growth.episodes import asked, draw
from scripts.growth.model import simulate
from scripts.growth.rules import Rules
from scripts.growth.stopwatch import watched


@dataclass(frozen=True)
class Checked:
    """Rollouts a second, measured and by the model, and the mean duration of an episode meanwhile [s].

    The machine's speed changes with what else it does, and the model takes it from the simulators'
    own clocks. What is checked is how well they are kept at work: `busy` is their share of the time.
    """

    agent: str
    simulators: int
    directions: int
    updates: int
    episode_s: float
    measured: float
    predicted: float
    busy: float


def check(
    name: str, agent: Agent, count: int, directions: int, updates: int, pairs: list[tuple[float, ...]], costs: Costs,
    rules: Rules,
) -> Checked:  # fmt: skip
    """Updates of the paper's settings on `count` simulator nodes; the first is not counted."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    config = SearchConfig(directions=directions)
    with simulators(count), fleet() as known:
        wait_for(known, count)
        rollouts = ServiceRollouts(known, Turns(), agent, Patience(), lambda: False, print)
        batches = asked(config, updates + 1)
        rollouts.run(agent.theta, batches[0])
        with watched() as watch:
            start = time.perf_counter()
            for place, tasks in enumerate(batches[1:]):
                # another theta in every update, by nothing that an episode would notice
                rollouts.run(agent.theta * type(agent.theta[0])(1.0 + 1e-6 * (place + 1)), tasks)
            wall_s = time.perf_counter() - start
    episode_s = watch.simulated_s / watch.episodes
    drawn = draw(pairs, directions, updates + 1, 0)
    later = [duration for update in drawn[1:] for duration in update]
    speed = episode_s * len(later) / sum(later)
    outcome = simulate([[speed * one for one in update] for update in drawn], count, costs, rules)
    measured = updates * 2 * directions / wall_s
    busy = watch.simulated_s / (count * wall_s)
    return Checked(name, count, directions, updates, episode_s, measured, outcome.rollouts_per_second(), busy)
