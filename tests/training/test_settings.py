"""A setting that would stop a training hours later is refused before it begins."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.training.settings import RANGES, check_settings
from tests.conftest import drs, refused

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(), lambda inner: st.lists(inner, max_size=2)
)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("gamma=abc", "The setting gamma is 'abc'; allowed are numbers from 0 to 1."),
        ("gamma=5", "gamma is 5"),
        ("train_freq=0", "train_freq is 0; allowed are whole numbers from 1 to"),
        ("learning_starts=-5", "learning_starts is -5"),
        ("batch_size=2.5", "batch_size is 2.5"),
    ],
)
def test_the_command_refuses_it_and_leaves_nothing(tmp_path: Path, setting: str, words: str) -> None:
    output = tmp_path / "agent.safetensors"
    result = drs("train", "sac", "PandaReach-v3", "--steps", 60, "-o", output, "--set", setting)
    refused(result, words)
    assert result.returncode == 2 and not any(tmp_path.iterdir())


@given(st.dictionaries(st.sampled_from([*RANGES, "ent_coef"]), JSON, max_size=3))
def test_whatever_is_given_is_taken_or_refused(settings: dict[str, object]) -> None:
    try:
        check_settings(settings)
    except UsageError:
        return
    for name in settings.keys() & RANGES.keys():
        least, most = RANGES[name]
        value = settings[name]
        assert (name == "train_freq" and isinstance(value, list)) or least <= value <= most


def test_words_and_pairs_of_the_algorithm_pass() -> None:
    check_settings({"ent_coef": "auto", "train_freq": [1, "episode"], "gradient_steps": -1, "gamma": 0.98})
