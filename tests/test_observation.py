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
        lambda: Pipeline((Part("a", 1), Part("a", 1)), is_dict=True),
        lambda: Pipeline((Part("observation", 1),), clip=0.0),
        lambda: Pipeline((Part("goal", 1),), is_dict=True, time_limit_steps=5),
    ],
)
def test_pipelines_that_cannot_be_are_refused(make):
    with pytest.raises(UsageError):
        make()
