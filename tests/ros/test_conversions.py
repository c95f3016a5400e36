"""Messages and the library's values turn into each other without loss; wild messages are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drs_interfaces.msg import Candidate, EpisodeResult, Observation
from hypothesis import given
from hypothesis import strategies as st

from drs.conversions import (
    answer_from_msg,
    candidate_to_msg,
    episode_from_msg,
    episode_to_msg,
    floats,
    observation_from_msg,
    task_from_msg,
    theta_from,
)
from drs_core.episode import DIMENSION, Episode, unfinished
from drs_core.errors import UsageError
from drs_core.measures.mesh_dimension import MeshDimension
from drs_core.measures.smoothness import TipMotion
from drs_core.rollouts import Task
from drs_core.rollouts.proof import vector_digest
from drs_core.scope import Scope
from drs_core.search import Perturbation

numbers = st.floats(allow_nan=False, width=64)


@given(
    st.integers(0, 2**63 - 1), st.integers(0, 999_999), st.integers(0, 65_535), st.sampled_from([-1, 1]),
    st.floats(0.0, 1e3), st.builds(Scope, st.integers(0, 99)) | st.sampled_from([Scope(88, 3), Scope(80, 10)]),
)  # fmt: skip
def test_a_task_comes_back(seed: int, update: int, direction: int, sign: int, sigma: float, scope: Scope) -> None:
    task = Task(seed, frozenset(), Perturbation(seed, update, direction, sign, sigma, scope))
    assert task_from_msg(candidate_to_msg(task), frozenset(), 100) == task


@given(numbers, st.integers(0, 10**6), st.sampled_from([None, True, False]), numbers, st.booleans())
def test_an_episode_comes_back(total: float, length: int, success: bool | None, number: float, measured: bool) -> None:
    episode = Episode(
        seed=length,
        return_=total,
        length=length,
        terminated=measured,
        failed=not measured,
        success=success,
        action_change=number,
        dimension=MeshDimension(number, total, 3.5) if measured else None,
        motion=TipMotion(number, total, 1.0, 2.0, number) if measured else None,
    )
    assert episode_from_msg(episode_to_msg(episode)) == episode


def test_a_dimension_that_cannot_be_computed_stays_so() -> None:
    episode = Episode(0, 0.0, 1, False, False, None, 0.0, dimension=MeshDimension(math.nan, math.nan, 3.0))
    back = episode_from_msg(episode_to_msg(episode)).dimension
    assert math.isnan(back.lower) and math.isnan(back.upper) and back.mean() == 3.0


def test_a_trajectory_comes_back() -> None:
    path = np.arange(12, dtype=np.float32).reshape(4, 3)
    episode = Episode(0, 0.0, 4, False, False, None, 0.0, tip_position=path, tip_velocity=path + 1)
    back = episode_from_msg(episode_to_msg(episode))
    assert np.array_equal(back.tip_position, path) and np.array_equal(back.tip_velocity, path + 1)


def test_an_episode_that_was_broken_off_comes_back_whatever_else_it_says() -> None:
    episode = unfinished(7, "reflex")
    back = answer_from_msg(episode_to_msg(episode), [DIMENSION])
    assert (back.seed, back.finished, back.why) == (7, False, "reflex")
    wild = EpisodeResult(seed=7, unfinished=True, why="\x1b[2Ja\n" * 10**5, return_sum=5.0, tip_position=[1.0])
    back = answer_from_msg(wild, [])
    assert not back.finished and math.isnan(back.return_) and back.tip_position is None
    assert len(back.why) < 1000 and back.why.isprintable()
    assert episode_from_msg(EpisodeResult(seed=7)).finished


def test_theta_comes_back_and_its_digest_sees_every_bit() -> None:
    theta = np.array([1.0, -2.5, 1e-30], np.float32)
    assert np.array_equal(theta_from(floats(theta)), theta)
    assert vector_digest(theta) != vector_digest(np.nextafter(theta, np.float32(2)))


@pytest.mark.parametrize("field", [{"sign": 2}, {"sign": 1, "sigma": -1.0}, {"sign": 1, "update": 2**31}])
def test_a_wild_candidate_is_refused(field: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        task_from_msg(Candidate(**field), frozenset(), 10)


@given(st.lists(st.integers(0, 2**32 - 1), max_size=4), st.integers(0, 20))
def test_sizes_of_an_observation_are_never_believed(sizes: list[int], values: int) -> None:
    message = Observation(keys=[str(i) for i in range(len(sizes))], sizes=sizes, values=[0.0] * values)
    try:
        parts = observation_from_msg(message)
    except UsageError:
        assert sum(sizes) != values
    else:
        assert [len(part) for part in parts.values()] == sizes
