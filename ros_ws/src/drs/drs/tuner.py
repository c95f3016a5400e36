"""What a tuner does, free of ROS but for the fleet: tune and evaluate on simulators, each in its turn."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from drs.fleet import Fleet
from drs.patience import Patience
from drs.pause import Pause
from drs.service_rollouts import ServiceRollouts
from drs.tuner_parameters import Job
from drs.turns import Turns
from drs_core.agent import Agent
from drs_core.errors import DrsError, UsageError
from drs_core.evaluation import Evaluation, check_seeds, evaluate
from drs_core.plan import Attendant
from drs_core.tuning import Observer, Tuning

MOST_EVALUATIONS = 4
"""Waiting or under way: each holds one of the node's threads."""

ShouldStop = Callable[[], bool]


@dataclass(frozen=True)
class Settings:
    """How long to wait [s], for one answer and for any simulator while evaluating; what runs evaluations, how often."""

    call_deadline_s: float
    evaluation_patience_s: float
    backend: str = "python"
    attempts: int = 3


class Tuner:
    """One run at a time, evaluations beside it.

    Attributes:
        pause: keeps both from beginning anything.
    """

    def __init__(
        self,
        fleet: Fleet,
        settings: Settings,
        should_stop: ShouldStop,
        say: Callable[[str], None],
        warn: Callable[[str], None],
    ) -> None:
        """`should_stop` is looked at several times a second; `warn` gets what a person should look at."""
        self._fleet, self._settings, self._should_stop, self._say, self._warn = fleet, settings, should_stop, say, warn
        self._turns, self._tuning = Turns(), threading.Lock()
        self.pause = Pause(lambda: fleet.moves(settings.call_deadline_s))
        self._evaluations = threading.BoundedSemaphore(MOST_EVALUATIONS)

    @property
    def tuning(self) -> bool:
        """Whether a run is under way."""
        return self._tuning.locked()

    def tune(
        self,
        job: Job,
        observer: Observer,
        begun: Callable[[int], None],
        should_stop: ShouldStop,
        attend: Callable[[ShouldStop], Attendant],
    ) -> Tuning:
        """Begin or continue a run and bring it to its end; `begun` gets the number of updates done before.

        `attend` makes whoever is asked before anything moves.

        Raises:
            Stopped: should_stop() became true; the run can be continued.
            UsageError: another run is under way, or the folder is of another one.
            DrsError: it failed.
        """
        if not self._tuning.acquire(blocking=False):
            raise UsageError("Another run is under way; cancel it, or wait for its end.")
        try:
            tuning = Tuning(
                job.agent, job.name, job.config, job.output, True, job.observe, job.stop_when_flat, self._warn
            )
            if job.plan:
                self._say(job.plan)
            begun(tuning.done)
            patience = Patience(self._settings.call_deadline_s)
            stop = lambda: should_stop() or self._should_stop()  # noqa: E731
            backend = job.config.backend
            rollouts = ServiceRollouts(self._fleet, self._turns, job.agent, patience, stop, self._warn, backend)
            tuning.run(rollouts, observer, attendant=attend(stop))
            return tuning
        finally:
            self._tuning.release()

    def evaluate(self, name: str, agent: Agent, episodes: int, seed: int) -> tuple[Evaluation, str]:
        """Evaluate an agent, and say how.

        Raises:
            UsageError: a number is out of range.
            DrsError: no simulator is there, or too many evaluations wait already.
        """
        check_seeds(episodes, seed)
        if not self._evaluations.acquire(blocking=False):
            raise DrsError(f"{MOST_EVALUATIONS} evaluations wait already; ask again later.")
        try:
            beside = " Took its turn beside a tuning run." if self.tuning else ""
            patience = Patience(self._settings.call_deadline_s, no_simulator_s=self._settings.evaluation_patience_s)
            rollouts = ServiceRollouts(
                self._fleet, self._turns, agent, patience, self._should_stop, self._warn, self._settings.backend
            )
            with self.pause.moving():
                done = evaluate(name, agent, rollouts, episodes, seed, attempts=self._settings.attempts)
            broken = f" {done.unfinished} could not be finished, and count nowhere." if done.unfinished else ""
            return done, f"Ran {episodes} episodes on {self._fleet.count()} simulators.{broken}{beside}"
        finally:
            self._evaluations.release()
