"""The helper's policy arithmetic, over all that a network can be."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drs_core.accelerator.compiled import CompiledRunner
from drs_core.accelerator.network import ACTIVATIONS, MAX_LAYERS
from drs_core.agent import Agent
from drs_core.environments import Environment, describe
from drs_core.errors import DrsError
from drs_core.observation import Part, Pipeline
from drs_core.policy import ACTIVATIONS as KNOWN
from drs_core.policy import Network
from tests.conftest import make_agent

pytestmark = pytest.mark.usefixtures("built")
ENVIRONMENT = "HopperBulletEnv-v0"
SPACES = describe(ENVIRONMENT)


@pytest.fixture(scope="module")
def world():
    environment = Environment(ENVIRONMENT)
    yield environment
    environment.close()


@st.composite
def agents(draw):
    rng, timed = np.random.default_rng(draw(st.integers(0, 2**32))), draw(st.booleans())
    size = SPACES.parts["observation"] + timed
    statistics = (rng.normal(size=size), rng.uniform(0.0, 2.0, size)) if draw(st.booleans()) else (None, None)
    pipeline = Pipeline((Part("observation", size, *statistics),), time_limit_steps=1000 if timed else None, clip=3.0)
    output = draw(st.sampled_from(["clip", "tanh"]))
    hidden = draw(st.lists(st.integers(1, 70), max_size=3))
    network = Network(
        (size, *hidden, len(SPACES.low)),
        draw(st.sampled_from(ACTIVATIONS)),
        output,
        draw(st.sampled_from([None, 0.5])) if output == "tanh" else None,
    )
    theta = (draw(st.sampled_from([0.1, 1.0])) * rng.standard_normal(network.parameters)).astype(np.float32)
    return Agent(ENVIRONMENT, pipeline, network, SPACES.low, SPACES.high, theta)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(agent=agents(), seed=st.integers(0, 2**62))
def test_any_agent_sees_the_same_and_acts_the_same(world, agent, seed):
    trace = CompiledRunner(agent, world).rollout(seed, 30)
    policy, pipeline = agent.policy(), agent.assembler()
    for step, (features, action) in enumerate(zip(trace.features, trace.actions, strict=True)):
        assert features.tobytes() == pipeline.features(trace.observations[step], step).tobytes()
        np.testing.assert_allclose(action, policy.act(features), rtol=0, atol=1e-6)


def test_it_knows_every_activation_there_is():
    assert set(ACTIVATIONS) == set(KNOWN)


def test_load_changes_the_policy(world):
    agent = make_agent(ENVIRONMENT)
    runner = CompiledRunner(agent, world)
    before = runner.rollout(1).actions[:5].copy()
    runner.load(-agent.theta)
    assert not np.array_equal(runner.rollout(1).actions[:5], before)
    runner.load(agent.theta)
    assert np.array_equal(runner.rollout(1).actions[:5], before)


def test_a_theta_that_is_not_finite_ends_in_a_sentence(world):
    agent = make_agent(ENVIRONMENT)
    runner = CompiledRunner(agent, world)
    runner.load(np.full_like(agent.theta, np.nan))
    with pytest.raises(DrsError, match="not finite"):
        runner.run(1)


def test_more_layers_than_it_takes(world):
    with pytest.raises(DrsError, match="64 layers"):
        CompiledRunner(make_agent(ENVIRONMENT, hidden=(2,) * MAX_LAYERS), world)
    CompiledRunner(make_agent(ENVIRONMENT, hidden=(2,) * (MAX_LAYERS - 1)), world).run(1)
