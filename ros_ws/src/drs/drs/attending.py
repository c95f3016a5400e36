"""The attendant of a run on the graph: says what moves next, and waits for a person where one asked for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from drs.pause import Pause
from drs.turns import Stopped
from drs_core.episode import Episode
from drs_core.plan import Plan


class Says(Protocol):
    """Whoever tells the graph."""

    def announce(self, sentence: str) -> None:
        """This moves next."""
        ...

    def paused(self, sentence: str) -> None:
        """Nothing moves until somebody says so."""
        ...

    def going_on(self, sentence: str) -> None:
        """It moves again."""
        ...

    def warn(self, sentence: str) -> None:
        """Something that a person should look at."""
        ...


class Attending:
    """An `Attendant` with a `Pause`."""

    def __init__(self, says: Says, pause: Pause, each: bool, should_stop: Callable[[], bool]) -> None:
        """With `each`, it pauses every time that something is about to move."""
        self._says, self._pause, self._each, self._should_stop = says, pause, each, should_stop

    def before(self, plan: Plan) -> None:
        """Announce it, and wait while there is a pause.

        Raises:
            Stopped: should_stop() became true.
        """
        self._says.announce(plan.sentence())
        ours = self._each and not self._pause.asked
        if ours:
            self._pause.ask()
        held: list[bool] = []

        def still() -> None:
            held.append(True)
            self._says.paused(f"Paused before {plan.name}: nothing moves until ~/resume is called.")

        try:
            self._pause.keep(self._should_stop, still)
        except Stopped:
            # what this run asked for ends with it; a person's own pause stays
            if ours:
                self._pause.end()
            raise
        if held:
            self._says.going_on(f"Going on with {plan.name}.")

    def on_unfinished(self, episodes: Sequence[Episode], again: bool) -> None:
        """Say how many, why, and what is done about them."""
        reasons = list(dict.fromkeys(episode.why or "no reason was given" for episode in episodes))
        more = f" and {len(reasons) - 3} more reasons" if len(reasons) > 3 else ""
        then = "they are run again, each with its other side" if again else "each is left out with its other side"
        self._says.warn(f"{len(episodes)} episodes were not finished ({'; '.join(reasons[:3])}{more}): {then}.")
