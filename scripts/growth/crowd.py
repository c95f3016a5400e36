"""The tuner with a crowd of simulators that sleep instead of computing, beside what the model says of them."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import numpy as np

from drs.bench_rollouts import fleet, wait_for
from drs.patience import Patience
from drs.run_node import SWITCH_INTERVAL_S
from drs.service_rollouts import ServiceRollouts
from drs.turns import Turns
from drs_core.importing import resolve
from drs_core.search import SearchConfig
from scripts.growth.costs import Costs
from scripts.growth.episodes import asked
from scripts.growth.model import simulate
from scripts.growth.points import NEAR
from scripts.growth.rules import Rules
from scripts.growth.stopwatch import watched
from scripts.growth.tuner_costs import claim, hollow

EPISODE_S = 0.1
_DIRECTIONS, _UPDATES = 128, 3


@dataclass(frozen=True)
class Crowd:
    """Rollouts a second, batches and the tuner's CPU time [s] of an update: measured, and by the model."""

    simulators: int
    ideal: float
    measured: float
    predicted: float
    calls_measured: float
    calls_predicted: float
    tuner_s_measured: float
    tuner_s_predicted: float


def crowd(agent_name: str, count: int, costs: Costs, rules: Rules) -> Crowd:
    """Updates of 128 directions of equal episodes, without the search's own work; the first is not counted."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    agent, config = resolve(agent_name), SearchConfig(directions=_DIRECTIONS)
    with hollow(agent_name, count, "sleep") as process, fleet() as known:
        wait_for(known, count)
        claim(process, EPISODE_S)
        rollouts = ServiceRollouts(known, Turns(), agent, Patience(), lambda: False, print)
        batches = asked(config, _UPDATES + 1)
        rollouts.run(agent.theta, batches[0])
        with watched() as watch:
            start, cpu = time.perf_counter(), time.process_time()
            for place, tasks in enumerate(batches[1:], 1):
                rollouts.run(agent.theta + np.float32(place), tasks)
            wall_s, cpu_s = time.perf_counter() - start, time.process_time() - cpu
    durations, alone = [EPISODE_S] * (2 * _DIRECTIONS), replace(costs, update_s=0.0, direction_s=0.0)
    first, all_ = (simulate([durations] * n, count, alone, rules, NEAR) for n in (1, _UPDATES + 1))
    return Crowd(
        count, count / EPISODE_S, _UPDATES * len(durations) / wall_s, all_.rollouts_per_second(),
        watch.calls / _UPDATES, (all_.calls - first.calls) / _UPDATES,
        cpu_s / _UPDATES, (all_.tuner_s - first.tuner_s) / _UPDATES,
    )  # fmt: skip
