import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.observation import Assembler, Part, Pipeline


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 20))
def test_normalisation_equals_vec_normalize(seed, clip):
    gymnasium = pytest.importorskip("gymnasium")
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    env = vec_env.DummyVecEnv([lambda: gymnasium.make("MountainCarContinuous-v0")])
    reference = vec_env.VecNormalize(env, clip_obs=clip)
    rng = np.random.default_rng(seed)
    reference.obs_rms.mean, reference.obs_rms.var = rng.normal(size=2), rng.uniform(0, 3, 2)
    raw = (10 * rng.standard_normal(2)).astype(np.float32)
    part = Part("observation", 2, reference.obs_rms.mean, reference.obs_rms.var)
    features = Assembler(Pipeline((part,), clip=clip)).features(raw, 0)
    assert features.tobytes() == reference.normalize_obs(raw).astype(np.float32).tobytes()


def test_the_time_feature_belongs_to_the_observation_part_of_a_dict():
    parts = (Part("achieved_goal", 1), Part("desired_goal", 1), Part("observation", 3))
    assembler = Assembler(Pipeline(parts, is_dict=True, time_limit_steps=50))
    raw = {"observation": np.array([5, 6]), "achieved_goal": np.array([1]), "desired_goal": np.array([2])}
    np.testing.assert_array_equal(assembler.features(raw, 0), np.float32([1, 2, 5, 6, 1]))
    np.testing.assert_array_equal(assembler.features(raw, 10), np.float32([1, 2, 5, 6, 0.8]))
    assert Pipeline(parts, is_dict=True).main == slice(2, 5)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 999))
def test_features_have_the_bits_of_the_formula_wherever_they_are_written(seed, step):
    rng = np.random.default_rng(seed)
    part = Part("observation", 4, rng.normal(size=4), rng.uniform(0, 1e-3, 4))
    parts = (Part("goal", 2), part)
    assembler = Assembler(Pipeline(parts, is_dict=True, time_limit_steps=1000))
    raw = {"observation": rng.normal(size=3).astype(np.float32), "goal": rng.normal(size=2).astype(np.float32)}
    timed = np.append(raw["observation"], np.float32(1.0 - step / 1000)).astype(np.float64)
    scaled = np.clip((timed - part.mean) / np.sqrt(part.variance + 1e-8), -10, 10).astype(np.float32)
    expected = np.concatenate((raw["goal"], scaled))
    rows = np.full((2, 6), np.nan, np.float32)
    assert assembler.features(raw, step).tobytes() == expected.tobytes()
    assert assembler.features(raw, step, rows[0]) is not None and rows[0].tobytes() == expected.tobytes()
    assert np.isnan(rows[1]).all()


def test_an_observation_of_another_size_is_not_broadcast_silently():
    with pytest.raises(ValueError):
        Assembler(Pipeline((Part("observation", 3),))).features(np.zeros(4), 0)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Part("a", 0),
        lambda: Part("a", 2, np.zeros(2)),
        lambda: Part("a", 2, np.zeros(3), np.zeros(3)),
        lambda: Part("a", 2, np.full(2, np.nan), np.ones(2)),
        lambda: Part("a", 2, np.zeros(2), -np.ones(2)),
        lambda: Pipeline(()),
        lambda: Pipeline((Part("observation", 1, np.zeros(1), np.zeros(1)),), epsilon=0.0),
        lambda: Pipeline((Part("a", 1), Part("a", 1)), is_dict=True),
        lambda: Pipeline((Part("observation", 1),), clip=0.0),
        lambda: Pipeline((Part("goal", 1),), is_dict=True, time_limit_steps=5),
    ],
)
def test_pipelines_that_cannot_be_are_refused(make):
    with pytest.raises(UsageError):
        make()
