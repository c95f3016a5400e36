"""The simulators that a tuner knows: found by their service type, each with what it holds and owes."""

from __future__ import annotations

import itertools
import math
import queue
import random
import time
from dataclasses import dataclass, field
from typing import Any

from drs_interfaces.srv import LoadAgent, RunEpisodes, SetParametersVector
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.client import Client
from rclpy.node import Node

from drs.answering import SERVICE_DEPTH

TYPE = "drs_interfaces/srv/RunEpisodes"
_SUFFIX = "/run_episodes"
_LOOK_PERIOD_S = 0.25
_SMOOTHING = 0.5
_HOLD_OFF_S, _MOST_HOLD_OFF_S = 0.5, 4.0


@dataclass(eq=False)
class Call:
    """One request that has not been answered.

    Attributes:
        run: number of the `run` that sent it; answers to earlier ones free the simulator, no more.
        kind: load, theta, episodes, or probe: whether what episodes need is in force.
        digest: of the theta, or of the agent with its backend, that is in force once it succeeds.
        tasks: places of its tasks.
        sent: when [s, monotonic].
        expected_s: how long it should take.
        copies: how many of its tasks others were asked to run too.
        id: comes back with the answer.
    """

    run: int
    kind: str
    digest: str = ""
    tasks: tuple[int, ...] = ()
    sent: float = field(default_factory=time.monotonic)
    expected_s: float = 0.0
    copies: int = 0
    id: int = field(default_factory=itertools.count(1).__next__)

    @property
    def age_s(self) -> float:
        """Time since it was sent [s]."""
        return time.monotonic() - self.sent


class Link:
    """One simulator node.

    Attributes:
        name: of the node.
        agent, theta: digests of what it holds (the agent's with its backend), as far as we know.
        calls: not answered yet, oldest first.
        probes: sent since it last ran episodes.
        failures: in a row, of what it was asked to do.
        episode_s: mean duration of one of its episodes; None before the first.
        refusal: why it cannot take part, and until when it is not asked again.
    """

    def __init__(self, node: Node, name: str, answers: queue.SimpleQueue[tuple[Link, Call, Any]]) -> None:
        """Make the clients."""
        self.name, self._node, self._answers = name, node, answers
        self._ends, self._heard = [self._make_ends()], time.monotonic()
        self.calls: list[Call] = []
        self.probes: list[Call] = []
        self._owed: set[Call] = set()
        self.failures = self._displaced = 0
        self.episode_s: float | None = None
        self.forget()
        self._held_off_until = 0.0
        self.refusal, self.refused_until = "", 0.0

    def _make_ends(self) -> dict[str, Client]:
        group = ReentrantCallbackGroup()
        return {
            kind: self._node.create_client(
                service, f"{self.name}/{end}", qos_profile=SERVICE_DEPTH, callback_group=group
            )
            for kind, service, end in (
                ("load", LoadAgent, "load_agent"),
                ("theta", SetParametersVector, "set_parameters_vector"),
                ("episodes", RunEpisodes, "run_episodes"),
            )
        }

    def ready(self) -> bool:
        """Whether its services are there."""
        return any(_ready(ends) for ends in self._ends)

    @property
    def silent_s(self) -> float:
        """For how long it has owed an answer that takes no time, and given none [s]; episodes may be long."""
        waited_s = max((call.age_s for call in self.calls if call.kind != "episodes"), default=0.0)
        return min(waited_s, time.monotonic() - self._heard)

    def renew(self) -> None:
        """Go on with new clients, beside those of before, which may be answered yet.

        On a network that loses packets a simulator may never be told of one end of the tuner's, and then
        drops every answer to it ("client will not receive response").
        """
        self._heard = time.monotonic()
        self._ends.append(self._make_ends())
        old, self._ends = self._ends[:-2], self._ends[-2:]
        for client in (client for ends in old for client in ends.values()):
            self._node.destroy_client(client)

    def forget(self) -> None:
        """Nothing is known of what it holds, and nothing more is expected from it."""
        self.agent = self.theta = ""
        self.calls, self.probes = [], []

    def refuse(self, why: str, for_s: float) -> None:
        """Leave it alone for a while."""
        self.forget()
        self.refusal, self.refused_until = why, time.monotonic() + for_s

    @property
    def refused(self) -> bool:
        """Whether it is left alone now."""
        return time.monotonic() < self.refused_until

    def displace(self) -> None:
        """It holds something else than it was sent, so what it was asked is lost; it is told again in a while.

        Two tuners with one simulator would else tell it in turn, and neither would run anything. So each
        leaves it to the other for a moment, whose length is drawn, and grows as long as nothing is run.
        """
        self.forget()
        wait_s = min(_HOLD_OFF_S * 2.0**self._displaced, _MOST_HOLD_OFF_S)
        self._held_off_until = time.monotonic() + random.uniform(wait_s, 2.0 * wait_s)
        self._displaced = min(self._displaced + 1, 9)

    @property
    def held_off(self) -> bool:
        """Whether it is left to others for a moment."""
        return time.monotonic() < self._held_off_until

    def send(self, call: Call, request: Any) -> None:
        """Send a request; its answer comes through the fleet's queue."""
        self.calls.append(call)
        if call.kind == "episodes":
            self._owed.add(call)
        self._ask(call.kind, call, request)

    def probe(self, call: Call, request: Any) -> None:
        """Send a request for no episodes; one that answers no call of its predecessor's answers it at once."""
        self.probes.append(call)
        self._ask("episodes", call, request)

    def _ask(self, end: str, call: Call, request: Any) -> None:
        ends = next((ends for ends in reversed(self._ends) if _ready(ends)), self._ends[-1])
        future = ends[end].call_async(request)
        future.add_done_callback(lambda done: self._answered(call, done.result()))

    def settle(self, call: Call) -> bool:
        """Take an answered call off those that are waited for; False where it was not waited for any more.

        One answer does for all requests of its kind and content that were sent; to episodes each call has its own.
        """
        known = call in self.calls
        same = lambda other: other.kind == call.kind != "episodes" and other.digest == call.digest  # noqa: E731
        self.calls = [other for other in self.calls if other is not call and not same(other)]
        return known

    def _answered(self, call: Call, response: Any) -> None:
        self._owed.discard(call)
        self._heard = time.monotonic()
        self._answers.put((self, call, response))

    def moves(self, deadline_s: float) -> bool:
        """Whether it has episodes to run still, also such that nobody waits for; not for longer than a deadline."""
        return self.ready() and any(call.age_s < deadline_s for call in list(self._owed))

    def learn(self, wall_s: float, episodes: int) -> None:
        """It ran episodes: take the measured duration into the mean, unless it is none."""
        self.failures = self._displaced = 0
        self.probes = []
        if episodes and 0.0 <= wall_s < math.inf:
            measured = wall_s / episodes
            known = measured if self.episode_s is None else self.episode_s
            self.episode_s = _SMOOTHING * measured + (1.0 - _SMOOTHING) * known


def _ready(ends: dict[str, Client]) -> bool:
    return all(client.service_is_ready() for client in ends.values())


class Fleet:
    """Every simulator in the graph; `refresh` finds new ones."""

    def __init__(self, node: Node) -> None:
        """Look for simulators of this node's graph."""
        self._node, self._looked = node, 0.0
        self._links: dict[str, Link] = {}
        self._lost: list[tuple[Link, Call]] = []
        self.answers: queue.SimpleQueue[tuple[Link, Call, Any]] = queue.SimpleQueue()

    def refresh(self) -> list[Link]:
        """Simulators whose services are there; looks at the graph four times a second at most."""
        if time.monotonic() - self._looked > _LOOK_PERIOD_S:
            self._looked = time.monotonic()
            for service, types in self._node.get_service_names_and_types():
                name = service.removesuffix(_SUFFIX)
                if TYPE in types and service.endswith(_SUFFIX) and name not in self._links:
                    self._links[name] = Link(self._node, name, self.answers)
        present = []
        for link in self._links.values():
            if link.ready():
                present.append(link)
            elif link.agent or link.calls:
                # gone: another one of that name would hold nothing
                self._lost += [(link, call) for call in link.calls]
                link.forget()
        return present

    def present(self) -> list[Link]:
        """Simulators whose services are there, as they were found last; from any thread."""
        return [link for link in list(self._links.values()) if link.ready()]

    def take_lost(self) -> list[tuple[Link, Call]]:
        """Calls of simulators that went away since the last time."""
        lost, self._lost = self._lost, []
        return lost

    def moves(self, deadline_s: float) -> bool:
        """Whether any has episodes to run still."""
        return any(link.moves(deadline_s) for link in list(self._links.values()))

    def count(self) -> int:
        """Simulators that take part."""
        return sum(not link.refused for link in self.present())
