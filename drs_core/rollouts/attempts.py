"""Tasks that belong together are run again as a whole until every episode of them is finished.

An arm may break an episode off (a reflex stop, an operator). Both sides of a direction are one group:
whichever side was broken off, both are run again, or both are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drs_core.episode import Episode
from drs_core.errors import DrsError
from drs_core.policy import Float32
from drs_core.rollouts.task import Progress, Rollouts, Task

ATTEMPTS = 3
MAX_ATTEMPTS = 100

OnUnfinished = Callable[[Sequence[Episode], bool], None]
"""Gets the episodes of an attempt that were broken off, and whether there is another attempt."""


@dataclass(frozen=True)
class Attempted:
    """What became of one group.

    Attributes:
        episodes: of its last attempt, in the order of its tasks.
        attempts: how often it was run.
    """

    episodes: list[Episode]
    attempts: int

    @property
    def finished(self) -> bool:
        """Whether every episode of the last attempt is."""
        return all(episode.finished for episode in self.episodes)


def run_groups(
    rollouts: Rollouts,
    theta: Float32,
    groups: Sequence[Sequence[Task]],
    attempts: int = ATTEMPTS,
    progress: Progress | None = None,
    on_unfinished: OnUnfinished | None = None,
) -> list[Attempted]:
    """Every group, in order; those with an unfinished episode again, after all others, `attempts` times in all.

    `progress` counts the episodes of the first attempt.
    """
    results: list[Attempted] = []
    left = list(range(len(groups)))
    for attempt in range(1, attempts + 1):
        tasks = [task for place in left for task in groups[place]]
        found = iter(rollouts.run(theta, tasks, progress if attempt == 1 else None))
        taken = [Attempted([next(found) for _ in groups[place]], attempt) for place in left]
        if attempt == 1:
            results = taken
        else:
            for place, group in zip(left, taken, strict=True):
                results[place] = group
        broken = [episode for group in taken for episode in group.episodes if not episode.finished]
        if not broken:
            break
        left = [place for place in left if not results[place].finished]
        if on_unfinished:
            on_unfinished(broken, attempt < attempts)
    return results


def check_enough(groups: Sequence[Attempted], what: str) -> None:
    """Raise DrsError where fewer than half of the groups are finished; `what` they are, in the plural."""
    broken = [group for group in groups if not group.finished]
    if 2 * len(broken) <= len(groups):
        return
    why = next(episode.why for group in broken for episode in group.episodes if not episode.finished)
    raise DrsError(
        f"Only {len(groups) - len(broken)} of {len(groups)} {what} could be finished in {broken[0].attempts} attempts "
        f"({why or 'no reason was given'}); at least half are needed. Mend the cause and go on: nothing was changed."
    )
