"""Which simulators failed which tasks, and when a task is given up."""

from __future__ import annotations

from collections.abc import Set

MOST_FAILURES = 3
"""Of one task, before it may be given up."""
MOST_IN_A_ROW = 2
"""Of one simulator, before it is left alone."""
MOST_THETAS_IN_A_ROW = 10
"""The same of refusals of theta: mostly another tuner has just loaded its own agent, and three of them meet often."""


class Failures:
    """Those of one update; simulators are known by their names.

    One broken simulator is quick, and takes more tasks than a whole fleet of healthy ones: so a task is
    given up only where no simulator is left that might still run it.
    """

    def __init__(self) -> None:
        """Nothing has failed."""
        self._by_task: dict[int, list[str]] = {}

    def __bool__(self) -> bool:
        """Whether any task failed."""
        return bool(self._by_task)

    def add(self, task: int, name: str) -> None:
        """It failed on this simulator."""
        self._by_task.setdefault(task, []).append(name)

    def given_up(self, task: int, able: Set[str]) -> bool:
        """Whether it failed often enough, and on each of those that are able."""
        names = self._by_task.get(task, [])
        return len(names) >= MOST_FAILURES and able <= set(names)

    def for_others(self, task: int, name: str, able: Set[str]) -> bool:
        """Whether this simulator failed it, and one that is able did not."""
        names = self._by_task.get(task, [])
        return name in names and not able <= set(names)

    def count(self, task: int) -> int:
        """How often it failed."""
        return len(self._by_task.get(task, []))
