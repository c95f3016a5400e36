"""The model of growth hands out what the tuner's own code does, and the measuring of its costs runs."""

from __future__ import annotations

import heapq
import itertools
import json
import os
import queue
import random
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drs_interfaces.srv import RunEpisodes, SetParametersVector

from drs.conversions import episode_to_msg
from drs.fleet import Call, Link
from drs.patience import Patience
from drs.service_rollouts import ServiceRollouts
from drs.turns import Turns
from drs_core.episode import Episode
from drs_core.rollouts import Task
from scripts.growth.costs import Costs, load_costs
from scripts.growth.model import simulate
from scripts.growth.rules import product_rules
from tests.conftest import make_agent
from tests.ros.graph import ROOT

LATENCY_S = 0.003


class Clock:
    """Time that passes while the tuner waits, and its simulators' answers in the order of time."""

    def __init__(self) -> None:
        self.now = 0.0
        self.answers: list[tuple[float, int, Any]] = []
        self.sizes: list[int] = []
        self._count = itertools.count()

    def monotonic(self) -> float:
        return self.now

    def answer(self, at_s: float, what: Any) -> None:
        heapq.heappush(self.answers, (at_s, next(self._count), what))

    def get(self, timeout: float) -> Any:
        if not self.answers or self.answers[0][0] > self.now + timeout:
            self.now += timeout
            raise queue.Empty
        at_s, _, what = heapq.heappop(self.answers)
        self.now = max(self.now, at_s)
        return what


class TimedLink(Link):
    """A simulator of the tuner whose episodes take what `durations` says by seed [s]."""

    def __init__(self, number: int, clock: Clock, durations: dict[int, float]) -> None:
        node = SimpleNamespace(create_client=lambda *_, **__: None, destroy_client=lambda _: True)
        super().__init__(node, f"/simulator_{number}", clock.answers)
        self._clock, self._durations, self._free = clock, durations, 0.0

    def send(self, call: Call, request: Any) -> None:
        call.sent = self._clock.now
        self.calls.append(call)
        response, took = SetParametersVector.Response(success=True), 0.0
        if call.kind == "episodes":
            seeds = [candidate.episode_seed for candidate in request.candidates]
            took = sum(self._durations[seed] for seed in seeds)
            episodes = [episode_to_msg(Episode(seed, 0.0, 1, False, False, None, 0.0)) for seed in seeds]
            response = RunEpisodes.Response(success=True, request_id=call.id, episodes=episodes, wall_s=took)
            self._clock.sizes.append(len(seeds))
        self._free = max(self._free, self._clock.now + LATENCY_S) + took
        self._clock.answer(self._free + LATENCY_S, (self, call, response))

    def probe(self, call: Call, request: Any) -> None:
        """It was not restarted, so it would answer only after its episodes, and change nothing."""
        self.probes.append(call)


def the_tuner(monkeypatch: pytest.MonkeyPatch, updates: list[list[float]], simulators: int) -> tuple[list[float], Any]:
    """When the tuner's own code ends each update, and the sizes of its batches."""
    clock, durations = Clock(), {}
    monkeypatch.setattr("drs.fleet.time", SimpleNamespace(monotonic=clock.monotonic))
    links = [TimedLink(number, clock, durations) for number in range(simulators)]
    fleet = SimpleNamespace(refresh=lambda: links, take_lost=list, answers=clock)
    agent, ends = make_agent(), []
    rollouts = ServiceRollouts(fleet, Turns(), agent, Patience(call_deadline_s=1e9), lambda: False, print)
    for link in links:
        link.agent = f"{agent.digest()} python"
    for update, found in enumerate(updates):
        tasks = [Task(1000 * update + place) for place in range(len(found))]
        durations.update((task.seed, duration) for task, duration in zip(tasks, found))
        rollouts.run(agent.theta + np.float32(update), tasks)
        ends.append(clock.now)
    return ends, clock.sizes


@pytest.mark.parametrize("simulators", [1, 2, 5, 24])
def test_it_hands_out_the_same_batches_at_the_same_moments(monkeypatch: pytest.MonkeyPatch, simulators: int) -> None:
    rng = random.Random(simulators)
    updates = [[rng.uniform(0.02, 0.4) for _ in range(96)] for _ in range(4)]
    updates[2][rng.randrange(96)] = 20.0  # the others are to run it again, and it delays the next update
    ends, sizes = the_tuner(monkeypatch, updates, simulators)
    model = simulate(updates, simulators, Costs(), product_rules(), LATENCY_S)
    assert list(model.sizes) == sizes
    assert model.ends_s == pytest.approx(ends, abs=1e-4)
    assert bool(model.copies) == (simulators > 1)


def test_costs_are_measured_over_a_graph_in_a_short_form(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "scripts.growth", "costs", "PandaReach=panda_reach", "--short"]
    from domain_coordinator import domain_id

    with domain_id() as domain:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path / "log")}
        result = subprocess.run(
            [*command, "--results", str(tmp_path)], capture_output=True, text=True, cwd=ROOT, env=environment
        )
    assert result.returncode == 0, result.stderr
    (costs,) = load_costs(tmp_path / "growth_costs.json").values()
    assert costs.send_call_s > 0 and costs.wake_s + costs.wake_link_s > 0 and costs.update_s > 0
    measured = json.loads((tmp_path / "growth_costs.json").read_text())["measured"]
    assert {row["simulators"] for row in measured} == {1, 2}
    assert all(row["answers"] == row["calls"] + row["simulators"] for row in measured)
