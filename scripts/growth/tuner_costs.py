"""What a tuner spends on its simulators: its own code, with hollow simulators over a real ROS 2 graph."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drs.bench_rollouts import fleet, simulators, wait_for
from drs.fleet import Fleet
from drs.patience import Patience
from drs.run_node import SWITCH_INTERVAL_S
from drs.service_rollouts import ServiceRollouts
from drs.turns import Turns
from drs_core.bench.processes import cpu_seconds
from drs_core.importing import resolve
from drs_core.rollouts import Task
from drs_core.search import SearchConfig, ask
from scripts.growth.stopwatch import Watch, watched

HOLLOW = Path(__file__).with_name("hollow.py")
CLAIMS_S = (0.5, 0.05, 0.01)
"""Claimed durations of an episode: batches of 1, 10 and 50."""
_DIRECTIONS_PER_LINK = 12
_LEAST_DIRECTIONS, _MOST_DIRECTIONS = 150, 1500
_LOOKS = 20


@dataclass(frozen=True)
class Measured:
    """One run of an update: on how many simulators, its watch, and CPU time of the tuner's other threads and theirs."""

    links: int
    watch: Watch
    others_s: float
    hollow_s: float

    def row(self) -> dict[str, float]:
        """What is kept of it: counts, and CPU time of a turn [us] in the tuner's loop and in its executor."""
        watch = self.watch
        counts = {"simulators": self.links, "answers": watch.turns, "calls": watch.calls, "episodes": watch.episodes}
        loop_us, executor_us = (round(1e6 * spent / watch.turns, 1) for spent in (watch.rest_s(), self.others_s))
        return {**counts, "loop_us": loop_us, "executor_us": executor_us}


@contextmanager
def hollow(agent: str, count: int, *how: str) -> Iterator[subprocess.Popen[str]]:
    """A process that offers the services of `count` simulators; `how` is nothing, or "sleep"."""
    command = [sys.executable, str(HOLLOW), agent, str(count), *how]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            assert process.stdout.readline() == "ready\n", "the hollow simulators did not start"
            yield process
        finally:
            process.stdin.close()


def claim(process: subprocess.Popen[str], episode_s: float) -> None:
    """Episodes take this long from now on, they say."""
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(f"{episode_s}\n")
    process.stdin.flush()
    process.stdout.readline()


def measure_fleet(agent_name: str, count: int, rounds: int) -> tuple[list[Measured], float]:
    """Updates on `count` hollow simulators, and what a look at their graph costs, a service [s]."""
    agent = resolve(agent_name)
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    directions = min(max(_LEAST_DIRECTIONS, _DIRECTIONS_PER_LINK * count), _MOST_DIRECTIONS)
    config, found = SearchConfig(directions=directions), []
    with hollow(agent_name, count) as process, fleet() as known:
        wait_for(known, count)
        rollouts = ServiceRollouts(known, Turns(), agent, Patience(), lambda: False, print)
        for number in range(rounds):
            for place, episode_s in enumerate(CLAIMS_S):
                claim(process, episode_s)
                update = number * len(CLAIMS_S) + place
                tasks = [Task(seed, perturbation=perturbation) for perturbation, seed in ask(config, update)]
                # the first tells the tuner how long episodes are
                rollouts.run(agent.theta + np.float32(0.5), tasks[: 4 * count])
                found.append(_one(rollouts, agent.theta + np.float32(update), tasks, count, process.pid))
        return found, _look_s(known)


def _one(rollouts: ServiceRollouts, theta: np.ndarray, tasks: Sequence[Task], count: int, pid: int) -> Measured:
    with watched() as watch:
        mine, thread, theirs = time.process_time(), time.thread_time(), cpu_seconds(pid)
        rollouts.run(theta, tasks)
        others = time.process_time() - mine - (time.thread_time() - thread)
        return Measured(count, watch, others, cpu_seconds(pid) - theirs)


def _look_s(known: Fleet) -> float:
    start = time.thread_time()
    for _ in range(_LOOKS):
        services = known._node.get_service_names_and_types()
    return (time.thread_time() - start) / _LOOKS / len(services)


def services_of_a_simulator() -> int:
    """How many services a simulator node offers, its parameters' included."""
    with simulators(1), fleet() as known:
        wait_for(known, 1)
        return sum(name.startswith("/bench_simulator_0/") for name, _ in known._node.get_service_names_and_types())


def fit(found: Sequence[Measured], look_s: float, services: int) -> dict[str, float]:
    """The costs that explain the measurements best, none of them negative (least squares of relative errors)."""
    turn = _solve([[m.watch.turns, m.watch.turns * m.links] for m in found], [m.watch.rest_s() for m in found])
    send = _solve([[m.watch.calls, m.watch.episodes] for m in found], [m.watch.spent_s["send"] for m in found])
    take = _solve([[m.watch.calls, m.watch.episodes] for m in found], [m.watch.spent_s["take"] for m in found])
    rows = [[m.watch.turns, m.watch.turns * m.links, m.watch.episodes] for m in found]
    wake = _solve(rows, [m.others_s for m in found])
    # with one hollow node in its process it has no more to wait for than a simulator
    alone = [m for m in found if m.links == min(m.links for m in found)]
    simulator = _solve([[m.watch.turns, m.watch.episodes] for m in alone], [m.hollow_s for m in alone])
    scans = [m for m in found if m.watch.looked]
    return {
        "turn_s": turn[0],
        "turn_link_s": turn[1],
        "wake_s": wake[0],
        "wake_link_s": wake[1],
        "scan_call_s": sum(m.watch.spent_s["scan"] for m in scans) / max(1, sum(m.watch.looked for m in scans)),
        "graph_link_s": look_s * services,
        "send_call_s": send[0],
        "send_episode_s": send[1],
        "take_call_s": take[0],
        "take_episode_s": take[1] + wake[2],
        "theta_s": sum(m.watch.spent_s["theta"] for m in found) / sum(m.watch.thetas for m in found),
        "simulator_call_s": simulator[0],
        "simulator_episode_s": simulator[1],
        "simulator_theta_s": simulator[0],
    }


def _solve(rows: Sequence[Sequence[float]], values: Sequence[float]) -> list[float]:
    from scipy.optimize import nnls

    weights = 1.0 / np.asarray(values)
    solution, _ = nnls(np.asarray(rows, dtype=float) * weights[:, None], np.asarray(values) * weights)
    return [float(value) for value in solution]
