"""How rows share the time, on a clock of the test's own."""

from hypothesis import example, given
from hypothesis import strategies as st

from drs_core.reproduce.grid import run_grid
from drs_core.reproduce.stopping import UNFINISHED, UPDATES

K = 40


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Row:
    """Stands in for a job: updates cost time, and a turn ends as a job's does."""

    def __init__(self, clock, update_s, evaluation_s):
        self.clock, self.update_s, self.cost_s = clock, update_s, evaluation_s
        self.updates, self.begun, self.concluded = 0, False, False

    def whole(self):
        return self.updates >= K and self.concluded

    def done(self):
        return self.updates

    def stop_reason(self):
        return UPDATES if self.updates >= K else UNFINISHED

    def evaluation_s(self):
        return self.cost_s if self.begun and not self.concluded else 0.0

    def work(self, _, until=None):
        if not self.begun:
            self.begun, self.clock.now = True, self.clock.now + self.cost_s
        last = K if until is None else min(K, (self.updates // 10 + 1) * 10)
        while self.updates < last:
            self.updates, self.clock.now = self.updates + 1, self.clock.now + self.update_s
            if until is not None and self.clock.now >= until:
                break
        if self.updates >= K:
            self.conclude(_)

    def conclude(self, _):
        if self.begun and self.updates and not self.concluded:
            self.concluded, self.clock.now = True, self.clock.now + self.cost_s


class Silent:
    def on_row(self, job):
        pass


def grid(costs, hours):
    clock = Clock()
    rows = [Row(clock, *cost) for cost in costs]
    run_grid(rows, hours, Silent(), clock)
    return rows, clock.now - 100.0


def test_without_a_limit_every_row_ends():
    rows, _ = grid([(1.0, 5.0), (100.0, 50.0)], None)
    assert [row.updates for row in rows] == [K, K] and all(row.concluded for row in rows)


def test_rows_advance_together_whatever_an_update_costs():
    rows, used = grid([(10.0, 10.0), (1.0, 1.0), (5.0, 5.0)], 0.1)
    updates = [row.updates for row in rows]
    assert min(updates) >= 10 and max(updates) - min(updates) <= 20
    assert all(row.concluded for row in rows)
    assert used <= 360 + 10


costs = st.lists(st.tuples(st.floats(0.1, 100.0), st.floats(0.1, 100.0)), min_size=1, max_size=6)


@given(costs, st.floats(0.01, 2.0))
@example([(1.0, 1.0), (5.0, 1.0), (35.0, 1.0), (97.0, 95.0), (77.0, 100.0), (1.0, 1.0)], 0.375)
def test_time_is_kept_and_everybody_has_something(rows_costs, hours):
    rows, used = grid(rows_costs, hours)
    evaluations = sum(evaluation_s for _, evaluation_s in rows_costs)
    updates = sum(update_s for update_s, _ in rows_costs)
    # at most an update a row and one baseline's evaluation come over
    assert used <= 3600 * hours + updates + 2 * evaluations
    if 3600 * hours > 4 * evaluations + 2 * updates + 1:
        assert all(row.updates and row.concluded for row in rows)
    assert all(row.concluded for row in rows if row.updates)
    if any(row.updates < K for row in rows):
        # time is not left lying about
        assert used + 2 * evaluations + updates >= 3600 * hours or any(not row.begun for row in rows)
