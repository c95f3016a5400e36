"""Whatever is broken off, groups are run again as a whole, after all others, and come back in their order."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.episode import Episode, unfinished
from drs_core.errors import DrsError
from drs_core.rollouts import Task, check_enough, run_groups

THETA = np.zeros(1, np.float32)


class Breaking:
    """Rollouts that break the episode of seed s off the first `broken[s]` times."""

    def __init__(self, broken):
        self.broken, self.runs, self.calls = broken, Counter(), []

    def run(self, theta, tasks, progress=None):
        self.calls.append([task.seed for task in tasks])
        return [self._one(task.seed) for task in tasks]

    def _one(self, seed):
        self.runs[seed] += 1
        if self.runs[seed] <= self.broken.get(seed, 0):
            return unfinished(seed, f"reflex {self.runs[seed]}")
        return Episode(seed, float(self.runs[seed]), 1, False, False, None, 0.0)

    def close(self):
        pass


@given(
    st.lists(st.integers(1, 3), min_size=1, max_size=8),
    st.dictionaries(st.integers(0, 23), st.integers(1, 5)),
    st.integers(1, 4),
)
def test_groups_are_run_until_all_of_them_is_finished_at_once(sizes, broken, attempts):
    seeds, groups = iter(range(sum(sizes))), []
    for size in sizes:
        groups.append([Task(next(seeds)) for _ in range(size)])
    rollouts, told = Breaking(broken), []
    found = run_groups(rollouts, THETA, groups, attempts, on_unfinished=lambda e, again: told.append((len(e), again)))
    assert [[e.seed for e in group.episodes] for group in found] == [[t.seed for t in group] for group in groups]
    for group, result in zip(groups, found, strict=True):
        needed = 1 + max(broken.get(task.seed, 0) for task in group)
        assert result.attempts == min(needed, attempts) and result.finished == (needed <= attempts)
        # both sides come from the same attempt, and none was run apart from the other
        assert {rollouts.runs[task.seed] for task in group} == {result.attempts}
    assert rollouts.calls[0] == list(range(sum(sizes)))
    assert all(not again for _, again in told[attempts - 1 :]) and all(again for _, again in told[: attempts - 1])


def test_fewer_than_half_is_an_error_that_says_why():
    groups = [[Task(2 * i), Task(2 * i + 1)] for i in range(4)]
    check_enough(run_groups(Breaking({0: 9, 3: 9}), THETA, groups), "pairs")
    found = run_groups(Breaking({0: 9, 3: 9, 5: 9}), THETA, groups)
    with pytest.raises(DrsError, match=r"Only 1 of 4 pairs could be finished in 3 attempts \(reflex 3\)"):
        check_enough(found, "pairs")
