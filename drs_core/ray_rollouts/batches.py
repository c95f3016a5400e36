"""How many episodes go into one task: enough that handing them out costs little, and all end together."""

from __future__ import annotations

TASK_S = 0.5
"""A task on its way costs 3 to 5 ms."""
_FIRST = 2
_MEMORY = 0.7


class BatchSize:
    """Learns how long an episode takes."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._episode_s: float | None = None

    def learn(self, episodes: int, duration_s: float) -> None:
        """A task of so many episodes took so long where it ran [s]."""
        newest = duration_s / episodes
        self._episode_s = newest if self._episode_s is None else _MEMORY * self._episode_s + (1.0 - _MEMORY) * newest

    def next(self, waiting: int, slots: int) -> int:
        """Episodes of the next task, where so many wait and so many tasks run at once.

        An even number while there are enough, so that both sides of a direction, which stand side by
        side, meet in one task and the direction is drawn once.
        """
        if waiting <= 0:
            return 0
        if self._episode_s is None:
            return min(_FIRST, waiting)
        wanted = int(TASK_S / max(self._episode_s, 1e-6))
        # towards the end smaller ones, so that nobody waits long for the last
        size = max(min(wanted, waiting // (2 * max(slots, 1))), 1)
        return min(size + size % 2, waiting)
