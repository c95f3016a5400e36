"""The paper's numbers, the choice of rows, and what a difference says: pure functions."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.environments import PAPER
from drs_core.errors import UsageError
from drs_core.measures.statistics import Interval, percent_difference_interval
from drs_core.reproduce.paper import FAILURE, RETURN, TABLES, TABLES_CSV, Printed, paper_rows
from drs_core.reproduce.selection import select
from drs_core.reproduce.stopping import COMPLETE, PATIENCE, UNFINISHED, UPDATES, reason, stalled
from drs_core.reproduce.verdict import BETTER, EQUAL, WORSE, against_paper, gain, mark


def test_the_packaged_tables_are_the_papers(shared: Path):
    assert TABLES_CSV.read_bytes() == (shared / "paper" / "tables.csv").read_bytes()


def test_every_row_of_every_table_is_there():
    assert {name: len(paper_rows(name)) for name in TABLES} == {"I": 47, "II": 6, "III": 24, "IV": 4}
    rows = [row for name in TABLES for row in paper_rows(name)]
    assert {row.environment for row in rows} == set(PAPER)
    lunar_lander = paper_rows("I")[6]
    assert (lunar_lander.name, lunar_lander.environment) == ("LunarLander-a2c", "LunarLanderContinuous-v3")
    assert lunar_lander.printed == {RETURN: (Printed(61.0, 137.3), Printed(160.0, 126.1))}
    assert paper_rows("II")[0].printed == {FAILURE: (Printed(19.33, None), Printed(12.0, None))}
    assert set(paper_rows("III")[0].printed) == {"return", "dimension"}
    with pytest.raises(UsageError, match="choose I, II"):
        paper_rows("V")


@pytest.mark.parametrize(
    ("asked", "numbers"),
    [
        ("1", [1]),
        ("Hopper-a2c", [36]),
        ("hopper-A2C,1", [1, 36]),
        ("HopperBulletEnv-v0-a2c", [36]),
        ("BipedalWalker", [13, 14, 15, 16, 17, 18]),
        ("*-td3,3", [3, 4, 10, 16, 21, 27, 33, 39, 45]),
    ],
)
def test_rows_are_chosen_by_number_name_and_pattern(asked, numbers):
    assert [row.number for row in select(paper_rows("I"), asked)] == numbers


@pytest.mark.parametrize("asked", ["0", "48", "", ",", "Cartpole", "Hopper-a2c,Panda*", "١٢٣"])
def test_a_wrong_row_lists_what_there_is(asked):
    with pytest.raises(UsageError, match=r"1 to 47.*MountainCar-a2c/ppo/ddpg.*Ant-a2c"):
        select(paper_rows("I"), asked)


@given(st.text(max_size=20))
def test_any_text_chooses_rows_or_is_refused(asked):
    try:
        assert select(paper_rows("IV"), asked)
    except UsageError as error:
        assert len(str(error)) < 700


@pytest.mark.parametrize(
    ("counts", "low", "high"),
    # Newcombe (1998), table II, method 10
    [
        ((56, 70, 48, 80), 5.24, 33.39),
        ((9, 10, 3, 10), 17.05, 80.90),
        ((6, 7, 2, 7), 5.82, 80.62),
        ((5, 56, 0, 29), -3.81, 19.26),
    ],
)
def test_the_interval_of_a_difference_of_proportions_is_the_published_one(counts, low, high):
    assert percent_difference_interval(*counts) == pytest.approx((low, high), abs=0.006)


proportion = st.integers(1, 300).flatmap(lambda total: st.tuples(st.integers(0, total), st.just(total)))


@given(proportion, proportion)
def test_the_interval_holds_the_difference_and_turns_with_it(one, other):
    low, high = percent_difference_interval(*one, *other)
    assert -100 - 1e-9 <= low <= 100 * (one[0] / one[1] - other[0] / other[1]) <= high <= 100 + 1e-9
    assert percent_difference_interval(*other, *one) == pytest.approx((-high, -low))


def values(mean, std, episodes):
    """(episodes,) float64 of exactly this mean and standard deviation."""
    z = np.linspace(-1, 1, episodes)
    return mean + std * z / z.std(ddof=1)


def test_better_is_beyond_both_errors_and_the_rounding():
    printed = Printed(1000.0, 100.0)
    error = 1.96 * (100.0**2 / 100 + 30.0**2 / 50) ** 0.5 + 0.5
    for difference, expected in ((1.01, BETTER), (0.99, EQUAL), (0.0, EQUAL), (-0.99, EQUAL), (-1.01, WORSE)):
        verdict = against_paper(RETURN, values(1000.0 + difference * error, 30.0, 50), printed, 100)
        assert verdict.mark == expected
        assert verdict.difference == pytest.approx(difference * error)
        assert verdict.interval == pytest.approx(((difference - 1) * error, (difference + 1) * error))


def test_a_printed_zero_spread_still_was_rounded():
    assert against_paper(RETURN, values(93.4, 0.0, 100), Printed(93.0, 0.0), 100).mark == EQUAL
    assert against_paper(RETURN, values(93.6, 0.0, 100), Printed(93.0, 0.0), 100).mark == BETTER


def test_less_dimension_and_fewer_failures_are_better():
    assert against_paper("dimension", values(2.0, 0.1, 100), Printed(2.28, 0.5), 100).mark == BETTER
    fails = np.repeat([100.0, 0.0], [3, 297])
    assert against_paper(FAILURE, fails, Printed(12.0, None), 300).mark == BETTER
    assert against_paper(FAILURE, fails, Printed(0.67, None), 300).mark == EQUAL
    assert against_paper(FAILURE, fails[::-1].repeat(10), Printed(0.0, None), 3000).mark == WORSE


@given(st.floats(-1e6, 1e6), st.floats(0, 1e6))
def test_marks_turn_with_the_sign(middle, half):
    interval = Interval(middle - half, middle + half)
    opposite = {BETTER: WORSE, WORSE: BETTER, EQUAL: EQUAL}
    assert mark(interval, -1) == opposite[mark(interval, 1)]
    assert (mark(interval, 1) == EQUAL) == (interval.low <= 0 <= interval.high)


def test_the_gain_is_paired():
    before = values(1000.0, 300.0, 100)
    mean, interval = gain(before, before + values(1.0, 0.1, 100))
    assert mean == pytest.approx(1.0)
    assert 0.9 < interval.low < 1.0 < interval.high < 1.1


def test_patience_counts_from_the_first_evaluation_that_none_has_topped():
    def records(*means):
        return [{"update": 10 * i, "objective_mean": mean} for i, mean in enumerate(means)]

    assert not stalled([], 10)
    assert not stalled(records(1.0), 10)
    assert stalled(records(1.0, 1.0), 10)
    assert not stalled(records(1.0, 2.0), 10)
    assert not stalled(records(1.0, 3.0, 2.0), 20)
    assert stalled(records(1.0, 3.0, 2.0, 3.0), 20)
    assert not stalled(records(1.0, 0.0, 0.0, 2.0), 20)
    assert not stalled(records(1.0, 0.0, 0.0, 0.0), 0)
    assert reason(200, 200, 200, records(1.0, 0.0), 10) == COMPLETE
    assert reason(7, 200, 7, records(1.0), 0) == UPDATES
    assert reason(10, 200, 50, records(1.0, 0.0), 10) == PATIENCE
    assert reason(10, 200, 50, records(1.0, 0.0), 20) == UNFINISHED
