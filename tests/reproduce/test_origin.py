"""With which versions of packages a row was made, in words."""

import pytest

from drs_core.reproduce.origin import in_line, records, sentences
from drs_core.versions import Part

NOW = {"drs": "0.1.0", "numpy": "2.4.6", "pybullet": "3.2.7"}
OLD = {**NOW, "numpy": "1.26.0", "pybullet": "3.2.5"}
OLDER = {**OLD, "numpy": "1.25"}


def row(name="A", **stages):
    return {
        "row": name,
        "made_with": records({stage: [Part(0, one) for one in made] for stage, made in stages.items()}),
    }


@pytest.mark.parametrize(
    ("stages", "said", "line"),
    [
        ({}, [], ""),
        ({"tuning": [NOW], "before": [NOW]}, [], "drs 0.1.0; numpy 2.4.6; pybullet 3.2.7"),
        (
            {"tuning": [OLD], "before": [OLD], "after": [OLD]},
            ["A was made with numpy 1.26.0 and pybullet 3.2.5."],
            "drs 0.1.0; numpy 1.26.0; pybullet 3.2.5",
        ),
        (
            {"tuning": [NOW, OLD], "before": [NOW]},
            ["A was made in part with numpy 1.26.0 and pybullet 3.2.5."],
            "drs 0.1.0; numpy 2.4.6 and 1.26.0; pybullet 3.2.7 and 3.2.5",
        ),
        (
            {"tuning": [OLD], "before": [OLDER]},
            ["A was made with numpy 1.26.0 and 1.25 and pybullet 3.2.5."],
            "drs 0.1.0; numpy 1.26.0 and 1.25; pybullet 3.2.5",
        ),
        ({"before": [{}]}, ["A was made with versions that are unknown."], "unknown"),
        (
            {"tuning": [NOW], "before": [{}]},
            ["A was made in part with versions that are unknown."],
            "drs 0.1.0; numpy 2.4.6; pybullet 3.2.7; in part unknown",
        ),
    ],
)
def test_what_is_not_of_now_is_named(stages, said, line):
    assert list(sentences([row(**stages)], NOW)) == said
    assert in_line(row(**stages)) == line


def test_rows_that_were_made_alike_share_a_sentence():
    rows = [row("A", tuning=[OLD]), row("B", tuning=[NOW]), row("C", tuning=[OLD]), row("D", tuning=[OLD, NOW])]
    assert list(sentences(rows, NOW)) == [
        "A and C were made with numpy 1.26.0 and pybullet 3.2.5.",
        "D was made in part with numpy 1.26.0 and pybullet 3.2.5.",
    ]
