"""Whole updates: what an objective costs, the search's own share, and how long workers wait at the end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from drs_core.agent import Agent
from drs_core.bench.agents import Size, bench_agent, random_agent
from drs_core.bench.config import BenchConfig
from drs_core.bench.interleave import interleaved
from drs_core.bench.processes import all_running, processes
from drs_core.bench.summary import ratio, spread
from drs_core.objective import Objective
from drs_core.rollouts import InProcess, ProcessPool, Rollouts, Task
from drs_core.search import SearchConfig, ask, tell

OBJECTIVE_ENVIRONMENT, TAIL_ENVIRONMENT = "HalfCheetahBulletEnv-v0", "HopperBulletEnv-v0"
SEARCH_ENVIRONMENTS = ("HalfCheetahBulletEnv-v0", "PandaPush-v3")
LARGE = Size((400, 300), "relu", "tanh", last_layer=0.01)
"""The zoo's largest common network: about 130,000 parameters."""
_DIRECTIONS, _TAIL_DIRECTIONS = 2, SearchConfig().directions
_SHORT_DIRECTIONS, _SHORT_TAIL_DIRECTIONS = 1, 4
"""Of an update, where the number of steps is given: then the run is to be short."""
_LOOK_S = 0.005

Record = dict[str, Any]


def update(
    rollouts: Rollouts, agent: Agent, config: SearchConfig, index: int, objective: Objective
) -> tuple[float, float]:
    """One update as a run makes it; CPU time of this process [s] outside the rollouts and in all."""
    start = time.process_time()
    tasks = [Task(seed, objective.measures, perturbation) for perturbation, seed in ask(config, index)]
    asked = time.process_time()
    episodes = rollouts.run(agent.theta, tasks)
    answered = time.process_time()
    objectives = np.array([objective(episode) for episode in episodes])
    tell(config, index, agent.theta, objectives.reshape(-1, 2))
    end = time.process_time()
    return (end - answered) + (asked - start), end - start


def objective_cost(config: BenchConfig, done: Callable[[], None]) -> Record:
    """CPU time of an update with the objective `dimension` over that with `return`, HalfCheetah."""
    agent, search = bench_agent(OBJECTIVE_ENVIRONMENT, config.agents), _search(config)
    with closing(InProcess(agent)) as rollouts:
        jobs = {
            name: partial(_whole, rollouts, agent, search, objective=Objective(name))
            for name in ("return", "dimension")
        }
        took = interleaved(jobs, config.rounds, done)
    return {"environment": OBJECTIVE_ENVIRONMENT, **asdict(ratio(took["dimension"], took["return"]))}


def _whole(rollouts: Rollouts, agent: Agent, search: SearchConfig, index: int, objective: Objective) -> float:
    return update(rollouts, agent, search, index, objective)[1]


def search_share(environment_id: str, config: BenchConfig, done: Callable[[], None]) -> Record:
    """Percent of an update's CPU time that goes into ask, candidates and tell, with a large network.

    All of them are linear in the number of directions, and so are the rollouts: few directions tell.
    """
    agent, search = random_agent(environment_id, LARGE), _search(config)

    def share(index: int) -> float:
        around, whole = update(rollouts, agent, search, index, Objective())
        start = time.process_time()
        # of another update: this one's newest direction is still known
        for perturbation, _ in ask(search, search.updates - 1 - index % search.updates):
            perturbation.candidate(agent.theta)
        return 100.0 * (around + time.process_time() - start) / whole

    with closing(InProcess(agent)) as rollouts:
        took = interleaved({"share": share}, config.rounds, done)
    return {"environment": environment_id, "parameters": len(agent.theta), **asdict(spread(took["share"]))}


def tail(config: BenchConfig, done: Callable[[], None], workers: int = 2) -> Record:
    """Percent of an update's wall time during which not all workers compute, Hopper: episodes of mixed length."""
    directions = _TAIL_DIRECTIONS if config.steps is None else _SHORT_TAIL_DIRECTIONS
    agent, search = bench_agent(TAIL_ENVIRONMENT, config.agents), SearchConfig(directions=directions)
    with ProcessPool(agent, workers) as pool:
        update(pool, agent, SearchConfig(directions=workers), 0, Objective())
        took = interleaved({"idle": partial(_idle_percent, pool, agent, search)}, config.rounds, done)
    return {
        "environment": TAIL_ENVIRONMENT,
        "workers": workers,
        "rollouts": 2 * directions,
        **asdict(spread(took["idle"])),
    }


def _search(config: BenchConfig) -> SearchConfig:
    return SearchConfig(directions=_DIRECTIONS if config.steps is None else _SHORT_DIRECTIONS)


def _idle_percent(pool: ProcessPool, agent: Agent, search: SearchConfig, index: int) -> float:
    with _Watcher(pool.pids) as watcher:
        update(pool, agent, search, index, Objective())
    return 100.0 * watcher.idle_share


class _Watcher:
    """Looks every few milliseconds whether all processes compute, from another thread."""

    def __init__(self, pids: Sequence[int]) -> None:
        self._watched, self._looks, self._idle, self._end = processes(pids), 0, 0, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def _watch(self) -> None:
        while not self._end.wait(_LOOK_S):
            self._looks += 1
            self._idle += not all_running(self._watched)

    @property
    def idle_share(self) -> float:
        return self._idle / max(1, self._looks)

    def __enter__(self) -> _Watcher:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()
