from pathlib import Path

import pytest

from drs_core.errors import UsageError
from drs_core.parameters import read_parameters
from drs_core.run_settings import read_run_settings

ROOT = Path(__file__).parents[1]


def written(tmp_path, text):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    return path


def test_a_nodes_section_wins_over_the_one_for_all_and_other_nodes_are_passed_over(tmp_path):
    path = written(
        tmp_path,
        """
        /**: {ros__parameters: {updates: 3, alpha: [1, 0.5]}}
        tuner_node: {ros__parameters: {updates: 4}}
        policy_node: {ros__parameters: {whatever: 1}}
        """,
    )
    assert read_parameters(path) == {"updates": 4, "alpha": (1.0, 0.5)}


def test_the_section_for_all_nodes_may_hold_what_another_node_has(tmp_path):
    path = written(tmp_path, "/**: {ros__parameters: {updates: 3, arm_id: fr3, use_sim_time: true}}")
    assert read_run_settings(path, {}).config.search.updates == 3
    for text in ("/**: {ros__parameters: {arm_idd: fr3}}", "tuner_node: {ros__parameters: {arm_id: fr3}}"):
        with pytest.raises(UsageError, match=r"'arm_idd?' is unknown"):
            read_run_settings(written(tmp_path, text), {})


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("updatse: 3", ["updatse", "unknown", "updates"]),
        ("updates: three", ["updates", "three", "whole number"]),
        ("updates: 3.5", ["updates", "whole number"]),
        ("updates: true", ["updates", "whole number"]),
        ("alpha: .nan", ["alpha", "two numbers"]),
        ("alpha: [0.1, .nan]", ["alpha", "finite"]),
        ("alpha: [0.1, .inf]", ["alpha", "finite"]),
        ("sigma: [0.1]", ["sigma", "two numbers"]),
        ("sigma: [1e-3, 1.0e-3]", ["sigma", "point", "1.0e-3"]),
        ("sigma: [small, 0.1]", ["sigma", "must be a finite number."]),
        ("objective: 3", ["objective", "text"]),
        ("last_layer: 1", ["last_layer", "true or false"]),
        ("updates: 0x" + "F" * 5000, ["updates", "whole number"]),
        (f"alpha: [1{'0' * 400}, 1]", ["alpha", "finite"]),
        ("smoothness_weight: .nan", ["smoothness_weight", "finite"]),
    ],
)
def test_a_wrong_key_or_value_is_named(tmp_path, line, words):
    with pytest.raises(UsageError) as error:
        read_parameters(written(tmp_path, f"/**:\n  ros__parameters:\n    {line}\n"))
    for word in [*words, "params.yaml"]:
        assert word in str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        "updates: 1",
        "tuner_nod: {ros__parameters: {updates: 1}}",
        "/**: {updates: 3, ros__parameters: {seed: 1}}",
        "a: &a [1]\n/**: {ros__parameters: {alpha: *a}}",
        "",
        "3",
        "- a",
        "/**: 3",
        "/**: {ros__parameters: 3}",
        "a: [",
        "!!python/object/apply:os.getcwd []",
        "\x00",
    ],
)
def test_a_file_of_another_layout_is_refused(tmp_path, text):
    with pytest.raises(UsageError, match=r"params\.yaml"):
        read_parameters(written(tmp_path, text))


def test_a_file_that_is_missing_or_huge(tmp_path):
    with pytest.raises(UsageError, match="not a file"):
        read_parameters(tmp_path / "none.yaml")
    with pytest.raises(UsageError, match="larger"):
        read_parameters(written(tmp_path, "#" * (2**20 + 1)))


@pytest.mark.parametrize("path", sorted((ROOT / "params").glob("*.yaml")), ids=lambda path: path.name)
def test_the_shipped_files_are_valid(path):
    assert read_parameters(path)
