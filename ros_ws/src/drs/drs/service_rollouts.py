"""The protocol `Rollouts` over simulator nodes, which may come, go, hang or die at any time.

An episode depends on its task alone, so it does not matter who runs it, or whether two do: the
first answer is taken, and an update comes out the same bit for bit.
"""

from __future__ import annotations

import array
import queue
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, cast

from drs_interfaces.srv import LoadAgent, RunEpisodes, SetParametersVector

from drs.conversions import answers_from_msg, candidate_to_msg, floats, is_not_held
from drs.dispatch import IN_FLIGHT, SILENT_S, batch_size, is_due, is_late, unfinished
from drs.failures import MOST_IN_A_ROW, MOST_THETAS_IN_A_ROW, Failures
from drs.fleet import Call, Fleet, Link
from drs.patience import Alone, Patience
from drs.turns import Stopped, Turns
from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.errors import DrsError, UsageError, presentable
from drs_core.policy import Float32
from drs_core.rollouts import Progress, Task
from drs_core.rollouts.proof import TEST, Proof

_LOOK_S = 0.1
_REFUSED_S = 10.0


class ServiceRollouts:
    """Episodes of one agent on the fleet; called from a thread of its own, not from a spinning one."""

    def __init__(
        self,
        fleet: Fleet,
        turns: Turns,
        agent: Agent,
        patience: Patience,
        should_stop: Callable[[], bool],
        log: Callable[[str], None],
        backend: str = "python",
    ) -> None:
        """`log` gets sentences for people; nothing is sent before the first `run`.

        A simulator that cannot run `backend` refuses the agent, and takes no part.
        """
        self._fleet, self._turns, self._patience = fleet, turns, patience
        self._should_stop, self._log = should_stop, log
        self._digest, self._content = agent.digest(), array.array("B", agent.to_bytes())
        self._backend, self._held = backend, f"{agent.digest()} {backend}"
        self._displaced: set[str] = set()

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """Every task's episode, in the order of tasks.

        Raises:
            Stopped: it was asked to stop.
            DrsError: an episode failed again and again, or nobody can run it.
        """
        alone = Alone(self._patience)

        def should_stop() -> bool:
            # whoever has the turn may wait for a simulator without end
            alone.look(self._fleet.present())
            return self._should_stop()

        with self._turns.turn(should_stop):
            return _Run(self, theta, tasks, progress, alone).until_done()

    def close(self) -> None:
        """Nothing to free: simulators live on."""


class _Run:
    """One call of `ServiceRollouts.run`."""

    _count = 0

    def __init__(
        self,
        parent: ServiceRollouts,
        theta: Float32,
        tasks: Sequence[Task],
        progress: Progress | None,
        alone: Alone,
    ) -> None:
        _Run._count += 1
        self._number, self._parent, self._fleet, self._patience = _Run._count, parent, parent._fleet, parent._patience
        self._tasks, self._progress, self._theta = tasks, progress, theta
        proof = Proof.of(theta)
        self._theta_digest, self._test_digest = proof.theta, proof.candidate
        self._measures = sorted(tasks[0].measure) if tasks else []
        self._episodes: list[Episode | None] = [None] * len(tasks)
        self._waiting, self._failures, self._done = deque(range(len(tasks))), Failures(), 0
        self._able: list[Link] = []
        self._alone = alone

    def until_done(self) -> list[Episode]:
        while self._done < len(self._tasks):
            if self._parent._should_stop():
                raise Stopped("Stopped; what is done is kept.")
            links = self._fleet.refresh()
            able = self._able = [link for link in links if not link.refused]
            self._watch(links)
            for link in able:
                self._feed(link, able)
            try:
                self._take(*self._fleet.answers.get(timeout=_LOOK_S))
            except queue.Empty:
                continue
        return cast(list[Episode], self._episodes)

    def _feed(self, link: Link, able: Sequence[Link]) -> None:
        if any(call.age_s > self._patience.call_deadline_s for call in link.calls):
            self._give_up(link)
            return
        if link.silent_s > SILENT_S:
            link.renew()
        if link.held_off:
            return
        if link.agent != self._parent._held:
            self._tell(link, "load", self._parent._held, self._load_request)
        elif link.theta != self._theta_digest:
            self._tell(link, "theta", self._theta_digest, self._theta_request)
        else:
            self._hand_out(link, able)
            self._probe(link)

    def _probe(self, link: Link) -> None:
        """Ask one that is late with everything whether it still holds what it was sent.

        One that is slow says so when it has run what it was asked before. One that was restarted under its
        old name answers at once, and will never answer what its predecessor was asked.
        """
        if link.episode_s is None:
            # nothing says what is late: an arm takes its time
            return
        late = link.calls and all(is_late(call.age_s, call.expected_s) for call in link.calls)
        if late and is_due([probe.age_s for probe in link.probes]):
            link.probe(Call(self._number, "probe"), self._episodes_request(0, ()))

    def _tell(self, link: Link, kind: str, digest: str, request: Callable[[], Any]) -> None:
        if is_due([call.age_s for call in link.calls if (call.run, call.kind) == (self._number, kind)]):
            link.send(Call(self._number, kind, digest), request())

    def _hand_out(self, link: Link, able: Sequence[Link]) -> None:
        while len(link.calls) < IN_FLIGHT and (places := self._next(link, able)):
            self._send_episodes(link, places)
        if not link.calls:
            others = (call for other in able if other is not link for call in other.calls if call.run == self._number)
            for call in others:
                left = unfinished(call.tasks, self._episodes)
                if left and is_late(call.age_s, call.expected_s):
                    self._send_episodes(link, [left[call.copies % len(left)]])
                    call.copies += 1
                    return

    def _next(self, link: Link, able: Sequence[Link]) -> list[int]:
        """Tasks of its next batch; what it failed is left to those that did not."""
        size = batch_size(len(self._waiting), len(able), link.episode_s)
        if not self._failures:
            return [self._waiting.popleft() for _ in range(size)]
        names = {other.name for other in able}
        places = [p for p in self._waiting if not self._failures.for_others(p, link.name, names)][:size]
        for place in places:
            self._waiting.remove(place)
        return places

    def _send_episodes(self, link: Link, places: Sequence[int]) -> None:
        # what was sent before has to end first
        expected = (link.episode_s or 0.0) * (len(places) + sum(len(call.tasks) for call in link.calls))
        call = Call(self._number, "episodes", tasks=tuple(places), expected_s=expected)
        link.send(call, self._episodes_request(call.id, places))

    def _episodes_request(self, number: int, places: Sequence[int]) -> RunEpisodes.Request:
        return RunEpisodes.Request(
            request_id=number,
            agent_digest=self._parent._digest,
            theta_digest=self._theta_digest,
            candidates=[candidate_to_msg(self._tasks[place]) for place in places],
            measures=self._measures,
            backend=self._parent._backend,
        )

    def _take(self, link: Link, call: Call, response: Any) -> None:
        if call.kind == "probe":
            if call.run == self._number and call in link.probes and is_not_held(response):
                self._displaced(link, _why(response))
            return
        known = link.settle(call)
        if call.kind == "episodes":
            # others have by now what failed after nobody waited for it any more
            if call.run == self._number and (known or response.success):
                self._take_episodes(link, call, response)
        elif not response.success:
            if known and call.run == self._number:
                self._take_refusal(link, call, _why(response))
        elif call.kind == "theta":
            link.theta, link.refusal = call.digest, ""
        else:
            # also where it was sent twice: loading puts the agent's own theta in force
            link.agent, link.theta = call.digest, ""

    def _take_refusal(self, link: Link, call: Call, why: str) -> None:
        if call.kind == "load":
            self._refuse(link, why)
            return
        self._failed(link, call, why, MOST_THETAS_IN_A_ROW)
        if not link.refused:
            self._displaced(link, why)

    def _displaced(self, link: Link, why: str, *also: Call) -> None:
        """The simulator holds something else than it was sent: no failure of anything that it was asked to run."""
        if link.name not in self._parent._displaced:
            self._parent._displaced.add(link.name)
            self._parent._log(
                f"{link.name} holds another agent or theta than it was sent, as after a restart or where another "
                f"tuner uses it too ({why}). It is told again; what it was asked to run is put back."
            )
        for call in (*also, *link.calls):
            self._put_back(call)
        link.displace()

    def _take_episodes(self, link: Link, call: Call, response: Any) -> None:
        if is_not_held(response):
            self._displaced(link, _why(response), call)
            return
        if not response.success:
            self._failed(link, call, _why(response), MOST_IN_A_ROW)
            return
        seeds = [self._tasks[place].seed for place in call.tasks]
        try:
            answers = answers_from_msg(response, call.id, seeds, self._measures)
        except UsageError as error:
            # what it says cannot be believed: the others run its tasks
            self._failed(link, call, str(error), 1)
            return
        link.learn(response.wall_s, len(answers))
        for place, episode in zip(call.tasks, answers):
            if self._episodes[place] is None:
                self._episodes[place] = episode
                self._done += 1
        if self._progress:
            self._progress(self._done)

    def _put_back(self, call: Call) -> None:
        left = unfinished(call.tasks, self._episodes) if call.run == self._number else []
        self._waiting.extendleft(place for place in reversed(left) if place not in self._waiting)

    def _failed(self, link: Link, call: Call, why: str, most: int) -> None:
        """The call failed; the simulator is left alone where that is its failure number `most` in a row."""
        if link.refused:
            # of a call that others have by now
            return
        link.failures += 1
        self._put_back(call)
        if link.failures >= most:
            self._refuse(link, why)
        self._count_failure(link, call, why)

    def _count_failure(self, link: Link, call: Call, why: str) -> None:
        able = {other.name for other in self._able if not other.refused}
        for place in unfinished(call.tasks, self._episodes):
            self._failures.add(place, link.name)
            if self._failures.given_up(place, able):
                times = self._failures.count(place)
                raise DrsError(f"The episode of seed {self._tasks[place].seed} failed {times} times: {why}")

    def _give_up(self, link: Link) -> None:
        self._parent._log(
            f"{link.name} has not answered for {self._patience.call_deadline_s:g} s; going on without it."
        )
        for call in link.calls:
            self._put_back(call)
        link.renew()
        link.refuse("it does not answer", _REFUSED_S)

    def _refuse(self, link: Link, why: str) -> None:
        self._parent._log(f"{link.name} cannot take part: {why}")
        for call in link.calls:
            self._put_back(call)
        link.refuse(why, _REFUSED_S)

    def _watch(self, links: Sequence[Link]) -> None:
        for link, call in self._fleet.take_lost():
            if call.run == self._number:
                self._put_back(call)
                self._count_failure(link, call, "its simulator went away")
        if waiting := self._alone.look(links):
            self._parent._log(waiting)

    def _load_request(self) -> LoadAgent.Request:
        return LoadAgent.Request(
            content=self._parent._content, digest=self._parent._digest, backend=self._parent._backend
        )

    def _theta_request(self) -> SetParametersVector.Request:
        return SetParametersVector.Request(
            agent_digest=self._parent._digest,
            theta=floats(self._theta),
            theta_digest=self._theta_digest,
            test=candidate_to_msg(Task(0, perturbation=TEST)),
            test_digest=self._test_digest,
        )


def _why(response: Any) -> str:
    return presentable(response.message) or "it gave no reason"
