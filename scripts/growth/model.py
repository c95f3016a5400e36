"""A model of the tuner and its simulators, event by event: one server that takes an answer at a time, N that run.

It follows `_Run.until_done` of service_rollouts.py: in every turn all simulators are fed, then one
answer is taken. The tuner's rules come in as an argument; see rules.py.
"""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from scripts.growth.costs import Costs
from scripts.growth.rules import Rules

LOOK_S = 0.1
"""How long the tuner waits for an answer before its next turn."""
GRAPH_PERIOD_S = 0.25
SMOOTHING = 0.5
"""Of the newest batch in a simulator's mean duration of an episode."""
_NEVER_S = 1e9


@dataclass(eq=False)
class Call:
    """One request: of which update, its tasks (none: theta), when it was sent and what it should take [s]."""

    update: int
    tasks: tuple[int, ...]
    sent_s: float
    expected_s: float
    copies: int = 0


@dataclass
class Simulator:
    """One simulator: its calls that are not answered, when it has done them all, what the tuner knows of it."""

    number: int
    calls: list[Call] = field(default_factory=list)
    free_s: float = 0.0
    episode_s: float | None = None
    theta: int = -1

    def learn(self, measured_s: float) -> None:
        """Take the mean duration of a batch's episodes in."""
        known = measured_s if self.episode_s is None else self.episode_s
        self.episode_s = SMOOTHING * measured_s + (1.0 - SMOOTHING) * known


@dataclass(frozen=True)
class Outcome:
    """What came of it.

    Attributes:
        ends_s: when each update ended.
        tuner_s: how long the tuner worked.
        calls: batches that were sent, copies included.
        copies: episodes that were sent to a second simulator.
        ran: for every update, how often each task was sent: once, and once more for every copy.
        sizes: sizes of the batches in the order of sending.
    """

    ends_s: tuple[float, ...]
    tuner_s: float
    calls: int
    copies: int
    ran: tuple[tuple[int, ...], ...]
    sizes: tuple[int, ...]

    def rollouts_per_second(self) -> float:
        """Of all updates but the first, in which the tuner does not know yet how long episodes are."""
        if len(self.ends_s) < 2:
            return len(self.ran[0]) / self.ends_s[0]
        return sum(map(len, self.ran[1:])) / (self.ends_s[-1] - self.ends_s[0])


def simulate(
    updates_s: Sequence[Sequence[float]], simulators: int, costs: Costs, rules: Rules, latency_s: float = 0.0
) -> Outcome:
    """Run updates of episodes of these durations [s] on this many simulators, whose messages take latency_s."""
    model = _Model(simulators, costs, rules, latency_s)
    ends = tuple(model.update(durations) for durations in updates_s)
    return Outcome(ends, model.worked_s, len(model.sizes), model.copies, tuple(model.ran), tuple(model.sizes))


class _Model:
    """The clock and everything that lives longer than an update."""

    def __init__(self, simulators: int, costs: Costs, rules: Rules, latency_s: float) -> None:
        self._costs, self._rules, self._latency_s = costs, rules, latency_s
        self._all = [Simulator(number) for number in range(simulators)]
        self._answers: list[tuple[float, int, Simulator, Call, float]] = []
        self._sent, self._update, self._looked_s = 0, -1, float("-inf")
        self.clock_s = self.worked_s = 0.0
        self.sizes: list[int] = []
        self.copies = 0
        self.ran: list[tuple[int, ...]] = []

    def update(self, durations: Sequence[float]) -> float:
        """One update; when it ended [s]."""
        self._update += 1
        self._durations = durations
        self._waiting, self._done = deque(range(len(durations))), 0
        self._results: list[bool | None] = [None] * len(durations)
        self._open: set[Call] = set()
        self._idle: set[int] = set()
        self._due: list[tuple[float, int, Simulator, Call]] = []
        self._overdue: list[tuple[int, int, Call]] = []
        self._given = [0] * len(durations)
        hungry = self._all
        while self._done < len(durations):
            self._turn(hungry)
            if self._answers and self._answers[0][0] <= self.clock_s + LOOK_S:
                hungry = [self._take()]
            else:
                self.clock_s += LOOK_S
                hungry = []
        # both sides of a direction were asked for
        self._work(self._costs.update_s + self._costs.direction_s * len(durations) / 2)
        self.ran.append(tuple(self._given))
        return self.clock_s

    def _work(self, duration_s: float) -> None:
        self.clock_s += duration_s
        self.worked_s += duration_s

    def _turn(self, hungry: Sequence[Simulator]) -> None:
        """The tuner looks at all; only those of `hungry` and idle ones can be given anything."""
        self._work(self._costs.turn_s + self._costs.turn_link_s * len(self._all))
        if self.clock_s - self._looked_s > GRAPH_PERIOD_S:
            self._looked_s = self.clock_s
            self._work(self._costs.graph_link_s * len(self._all))
        for simulator in hungry:
            self._feed(simulator)
        if not self._waiting:
            self._copy_late()

    def _feed(self, simulator: Simulator) -> None:
        if simulator.theta != self._update:
            if not any(call.update == self._update for call in simulator.calls):
                self._work(self._costs.theta_s)
                self._send(simulator, Call(self._update, (), self.clock_s, 0.0), self._costs.simulator_theta_s, 0.0)
            return
        while self._waiting and len(simulator.calls) < self._rules.in_flight:
            size = self._rules.batch_size(len(self._waiting), len(self._all), simulator.episode_s)
            self._send_episodes(simulator, [self._waiting.popleft() for _ in range(size)])

    def _copy_late(self) -> None:
        """Whoever is idle looks at the others' calls, and runs again what another one is late with."""
        for number in sorted(self._idle) if self._late() else ():
            found = self._late()
            if found is None:
                break
            left = self._rules.unfinished(found.tasks, self._results)
            self._send_episodes(self._all[number], [left[found.copies % len(left)]])
            found.copies += 1
            self.copies += 1
        # those that are still idle looked in vain
        self._work(self._costs.scan_call_s * len(self._open) * len(self._idle))

    def _late(self) -> Call | None:
        """Of the calls that are late, the first simulator's oldest."""
        while self._due and self._due[0][0] <= self.clock_s:
            _, sent, simulator, call = heapq.heappop(self._due)
            heapq.heappush(self._overdue, (simulator.number, sent, call))
        while self._overdue:
            call = self._overdue[0][2]
            if call in self._open and self._rules.unfinished(call.tasks, self._results):
                return call
            heapq.heappop(self._overdue)
        return None

    def _send_episodes(self, simulator: Simulator, tasks: Sequence[int]) -> None:
        costs, count = self._costs, len(tasks)
        waits = count + sum(len(call.tasks) for call in simulator.calls)
        self._work(costs.send_call_s + costs.send_episode_s * count)
        call = Call(self._update, tuple(tasks), self.clock_s, (simulator.episode_s or 0.0) * waits)
        ran_s = sum(self._durations[task] for task in tasks)
        self._send(simulator, call, costs.simulator_call_s + costs.simulator_episode_s * count, ran_s)
        heapq.heappush(
            self._due, (self.clock_s + _late_after_s(self._rules, call.expected_s), self._sent, simulator, call)
        )
        self.sizes.append(count)
        for task in tasks:
            self._given[task] += 1

    def _send(self, simulator: Simulator, call: Call, overhead_s: float, ran_s: float) -> None:
        simulator.calls.append(call)
        self._open.add(call)
        self._idle.discard(simulator.number)
        begins_s = max(simulator.free_s, self.clock_s + self._latency_s)
        simulator.free_s = begins_s + overhead_s + ran_s
        self._sent += 1
        heapq.heappush(self._answers, (simulator.free_s + self._latency_s, self._sent, simulator, call, ran_s))

    def _take(self) -> Simulator:
        when_s, _, simulator, call, ran_s = heapq.heappop(self._answers)
        self.clock_s = max(self.clock_s, when_s)
        costs, count = self._costs, len(call.tasks)
        self._work(costs.wake_s + costs.wake_link_s * len(self._all))
        simulator.calls.remove(call)
        self._open.discard(call)
        if call.update == self._update and not call.tasks:
            simulator.theta = self._update
        if not simulator.calls and simulator.theta == self._update:
            self._idle.add(simulator.number)
        if call.update != self._update or not call.tasks:
            return simulator
        self._work(costs.take_call_s + costs.take_episode_s * count)
        simulator.learn(ran_s / count)
        for task in call.tasks:
            if self._results[task] is None:
                self._results[task] = True
                self._done += 1
        return simulator


@lru_cache(maxsize=4096)
def _late_after_s(rules: Rules, expected_s: float) -> float:
    """The age at which a call becomes late [s], from the tuner's own rule, to a microsecond."""
    young, old = 0.0, 1.0
    while not rules.is_late(old, expected_s):
        if old > _NEVER_S:
            return math.inf
        young, old = old, 2.0 * old
    while old - young > 1e-6:
        middle = 0.5 * (young + old)
        young, old = (young, middle) if rules.is_late(middle, expected_s) else (middle, old)
    return old
