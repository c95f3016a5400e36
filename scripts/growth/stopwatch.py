"""The tuner's own run of rollouts, with a watch on each of its parts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from drs import service_rollouts
from drs.fleet import Link

_PARTS = ("send", "take", "scan", "theta", "counting", "all")
_METHODS = ("until_done", "_hand_out", "_send_episodes", "_take", "_take_episodes", "_theta_request")


@dataclass
class Watch:
    """CPU time of the tuner's thread in each part [s], and how often.

    Attributes:
        spent_s: by part; `all` holds the others, `counting` is the watch's own.
        turns: answers taken, of whatever kind.
        calls, episodes, thetas: batches, episodes in them, and vectors sent.
        looked: calls that idle simulators looked at.
        simulated_s: what simulators say that episodes took.
    """

    spent_s: dict[str, float] = field(default_factory=lambda: dict.fromkeys(_PARTS, 0.0))
    turns: int = 0
    calls: int = 0
    episodes: int = 0
    thetas: int = 0
    looked: int = 0
    simulated_s: float = 0.0

    def timed(self, part: str, work: Callable[[], Any]) -> Any:
        """Its result; its time goes to `part`."""
        start = time.thread_time()
        try:
            return work()
        finally:
            self.spent_s[part] += time.thread_time() - start

    def rest_s(self) -> float:
        """Of the turns themselves."""
        return self.spent_s["all"] - sum(self.spent_s[part] for part in _PARTS if part != "all")


@contextmanager
def watched() -> Iterator[Watch]:
    """Inside, every run of ServiceRollouts is timed; its own methods are, so that its numbering goes on."""
    watch, run, send = Watch(), service_rollouts._Run, Link.send
    plain = {name: getattr(run, name) for name in _METHODS}
    try:
        for name, method in zip(_METHODS, _timed_methods(watch, plain)):
            setattr(run, name, method)
        Link.send = _timed_send(watch, send)  # type: ignore[method-assign]
        yield watch
    finally:
        for name, method in plain.items():
            setattr(run, name, method)
        Link.send = send  # type: ignore[method-assign]


def _timed_methods(watch: Watch, plain: dict[str, Callable[..., Any]]) -> tuple[Callable[..., Any], ...]:
    """Of _METHODS."""

    def until_done(self: Any) -> Any:
        return watch.timed("all", lambda: plain["until_done"](self))

    def hand_out(self: Any, link: Link, able: Sequence[Link]) -> None:
        if self._waiting or link.calls:
            plain["_hand_out"](self, link, able)
            return
        watch.looked += watch.timed("counting", lambda: _calls_of(self._number, able))
        watch.timed("scan", lambda: plain["_hand_out"](self, link, able))

    def send_episodes(self: Any, link: Link, places: Sequence[int]) -> None:
        watch.calls += 1
        watch.episodes += len(places)
        watch.timed("send", lambda: plain["_send_episodes"](self, link, places))

    def take(self: Any, link: Link, call: Any, response: Any) -> None:
        watch.turns += 1
        plain["_take"](self, link, call, response)

    def take_episodes(self: Any, link: Link, call: Any, response: Any) -> None:
        watch.simulated_s += response.wall_s
        watch.timed("take", lambda: plain["_take_episodes"](self, link, call, response))

    def theta_request(self: Any) -> Any:
        return watch.timed("theta", lambda: plain["_theta_request"](self))

    return until_done, hand_out, send_episodes, take, take_episodes, theta_request


def _calls_of(run: int, links: Sequence[Link]) -> int:
    return sum(call.run == run for link in links for call in link.calls)


def _timed_send(watch: Watch, send: Callable[[Link, Any, Any], None]) -> Callable[[Link, Any, Any], None]:
    def timed_send(link: Link, call: Any, request: Any) -> None:
        if call.kind == "theta":
            watch.thetas += 1
            watch.timed("theta", lambda: send(link, call, request))
        else:
            send(link, call, request)

    return timed_send
