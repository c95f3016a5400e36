"""What a run is about to move, for whoever stands beside it, and who that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drs_core.environments.timing import known_timing
from drs_core.episode import Episode


@dataclass(frozen=True)
class Plan:
    """The next episodes of a run.

    Attributes:
        environment: gymnasium id.
        update: k, from 1; None for episodes of the agent as it is before the first or after the last update.
        updates: K.
        pairs: n, directions of the update; none without one.
        evaluations: episodes of the agent as it is.
        baseline: episodes of the agent that the run began with.
        sigma: of the update's perturbations.
        change: with a cap of sigma, the largest change of an action on recorded observations [unit of the action].
    """

    environment: str
    update: int | None
    updates: int
    pairs: int = 0
    evaluations: int = 0
    baseline: int = 0
    sigma: float = 0.0
    change: float | None = None

    @property
    def episodes(self) -> int:
        """Of all kinds, unless some have to be repeated."""
        return 2 * self.pairs + self.evaluations + self.baseline

    @property
    def name(self) -> str:
        """What it is called."""
        return "an evaluation" if self.update is None else f"update {self.update} of {self.updates}"

    def sentence(self) -> str:
        """For people: how many episodes, how long, and how different from what the agent does now."""
        kinds = [f"{2 * self.pairs} episodes with the policy changed by sigma {self.sigma:.4g}"] if self.pairs else []
        if self.baseline:
            kinds.append(f"{self.baseline} episodes with the policy that the run began with")
        if self.evaluations:
            kinds.append(f"{self.evaluations} {'' if kinds else 'episodes '}with the policy as it is")
        time = known_timing(self.environment)
        lasting = (
            f", each of at most {time}, {_duration(self.episodes * time.episode_s)} in all without resets"
            if time
            else ""
        )
        text = f"Next: {self.name}: {' and '.join(kinds)}{lasting}."
        if self.change is not None:
            text += f" On the recorded observations no action changes by more than {self.change:.3g}."
        return text


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.1f} min"


class Attendant(Protocol):
    """Whoever stands beside what the episodes move."""

    def before(self, plan: Plan) -> None:
        """Called before anything moves; may wait, and may raise to end the run, which can be continued."""
        ...

    def on_unfinished(self, episodes: Sequence[Episode], again: bool) -> None:
        """These were broken off; whether they are run again."""
        ...


class Nobody:
    """An attendant who lets everything happen."""

    def before(self, plan: Plan) -> None:
        """Do not wait."""

    def on_unfinished(self, episodes: Sequence[Episode], again: bool) -> None:
        """Say nothing."""
