from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.evaluation import comparison
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.report.verdict import BETTER, EQUAL, UNCLEAR, WORSE, headline, lines, number
from tests.test_evaluation import evaluation


def compared(before, after):
    return comparison(evaluation(before), evaluation(after))


SPREAD = [float(i % 10) for i in range(40)]


@pytest.mark.parametrize(
    ("after", "verdict", "words"),
    [
        ([v + 2 + i % 3 for i, v in enumerate(SPREAD)], BETTER, "The return rose from 4.50 to"),
        ([v - 2 - i % 3 for i, v in enumerate(SPREAD)], WORSE, "it is worse"),
        ([v + (-1) ** i for i, v in enumerate(SPREAD)], UNCLEAR, "No clear difference in the return"),
        (SPREAD, EQUAL, "No difference: the return is the same in every episode"),
    ],
)
def test_the_title_says_what_the_interval_of_the_paired_difference_allows(after, verdict, words):
    result = compared(SPREAD, after)
    table = {line.key: line for line in lines(result["before"], result)}
    assert table["return_mean"].verdict == verdict
    assert words in headline("return", result).title


def test_what_a_gain_costs_in_return_stands_in_the_title():
    result = compared(SPREAD, [v - 2 - i % 3 for i, v in enumerate(SPREAD)])
    change = {"mean": -0.05, "ci95": [-0.06, -0.04], "probability_after_better": 1.0}
    result["differences"]["action_change"] = change
    result["after"]["action_change_mean"] = 0.05
    assert headline("smooth", result).title == "Its actions change 2.0 times less, for 3 less return"
    result["differences"]["action_change"] = {**change, "probability_after_better": 0.0}
    assert headline("smooth", result).title.startswith("Worse: its actions")


def test_a_search_for_less_dimension_is_judged_by_it():
    before = evaluation(SPREAD)
    lower = [replace(e, dimension=MeshDimension(0.5 + 0.01 * e.seed, 2.0, 5.0)) for e in before.episodes]
    after = replace(before, episodes=lower)
    returns = replace(after, episodes=[replace(e, return_=e.return_ - 2 - e.seed % 3) for e in lower])
    assert headline("dimension", comparison(before, after)).title == "The mesh dimension fell from 2.00 to 1.35"
    dearer = headline("dimension", comparison(before, returns))
    assert dearer.title == "The mesh dimension fell from 2.00 to 1.35, for 3 less return"
    assert "(better); return" in dearer.sentence and dearer.keys[:2] == ("dimension_mean", "return_mean")
    worse = headline("dimension", comparison(after, before)).title
    assert worse == "The mesh dimension rose from 1.35 to 2.00 \N{EM DASH} it is worse"


def test_numbers_are_written_as_people_read_them():
    assert number(-1.84, ".2f") == "\N{MINUS SIGN}1.84"
    assert number(-0.001, ".2f") == "0.00"
    assert number(1.2345e6, ".3g") == "1.23\N{MULTIPLICATION SIGN}10\N{SUPERSCRIPT SIX}"
    assert number(2e-7, ".3g") == "2\N{MULTIPLICATION SIGN}10\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT SEVEN}"


@given(st.floats(-1e12, 1e12), st.sampled_from([".2f", ".4g", ".3g", ".1f"]))
def test_a_written_number_is_the_number(value, form):
    back = str.maketrans("\N{MINUS SIGN}⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "--0123456789")
    text = number(value, form).replace("\N{MULTIPLICATION SIGN}10", "e").translate(back)
    assert float(text) == float(format(value, form))
