"""The cap holds for every candidate, and takes no more than it has to."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.observation import Part, Pipeline
from drs_core.policy import Network
from drs_core.search import SearchConfig, ask
from drs_core.sigma_cap import RESOLUTION, ActionChange, capped_sigma


def made(seed, hidden, activation, output, scale):
    rng = np.random.default_rng(seed)
    network = Network((3, *hidden, 2), activation, output)
    theta = (scale * rng.standard_normal(network.parameters)).astype(np.float32)
    low, high = np.array([-1.0, -2.0], np.float32), np.array([1.0, 0.5], np.float32)
    agent = Agent("Pendulum-v1", Pipeline((Part("observation", 3),)), network, low, high, theta)
    return agent, rng.standard_normal((9, 3)).astype(np.float32)


def largest(agent, seen, perturbations):
    """The largest change of an action, by policies of their own."""
    policy, other = agent.policy(), agent.policy()
    found = 0.0
    for perturbation in perturbations:
        other.load(perturbation.candidate(agent.theta))
        for row in seen:
            found = max(found, np.abs(policy.act(row).astype(np.float64) - other.act(row)).max())
    return found


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32), st.sampled_from([(), (4,), (5, 3)]), st.sampled_from(["tanh", "relu", "silu"]),
    st.sampled_from(["clip", "tanh"]), st.floats(0.01, 3.0), st.floats(1e-4, 10.0), st.floats(1e-3, 1.0),
    st.sampled_from([{}, {"last_layer": True}, {"action_gains": True}]),
)  # fmt: skip
def test_the_cap_holds_for_every_candidate(seed, hidden, activation, output, scale, sigma, most, part):
    agent, seen = made(seed, hidden, activation, output, scale)
    config = SearchConfig(directions=3, sigma=(sigma, sigma), seed=seed)
    scope = agent.network.scope(**part)
    perturbations = [perturbation for perturbation, _ in ask(config, 4, scope)]
    whole = largest(agent, seen, perturbations)
    capped = capped_sigma(ActionChange(agent, seen).around(agent.theta), perturbations, most)
    lowered = [replace(perturbation, sigma=capped.sigma) for perturbation in perturbations]
    assert capped.change == largest(agent, seen, lowered) <= most
    if whole <= most:
        assert capped.sigma == sigma
    else:
        # some direction bore no more
        assert 0.0 < capped.sigma < sigma
    again = capped_sigma(ActionChange(agent, seen).around(agent.theta), perturbations, most)
    assert again == capped
    assert [p for p, _ in ask(config, 4, scope, capped.sigma)] == lowered


@given(st.integers(0, 2**32), st.floats(1e-3, 0.1))
@settings(max_examples=30, deadline=None)
def test_where_actions_grow_with_sigma_it_is_the_largest(seed, most):
    """One layer with wide bounds: a change is in proportion to sigma."""
    agent, seen = made(seed, (), "tanh", "clip", 0.0)
    wide = np.array([1e6, 1e6], np.float32)
    agent = replace(agent, low=-wide, high=wide)
    perturbations = [p for p, _ in ask(SearchConfig(directions=4, sigma=(1.0, 1.0), seed=seed), 0)]
    capped = capped_sigma(ActionChange(agent, seen).around(agent.theta), perturbations, most)
    if capped.sigma < 1.0:
        more = (1.0 + 2.0 * RESOLUTION) * capped.sigma
        assert largest(agent, seen, [replace(p, sigma=more) for p in perturbations]) > most


def test_a_cap_that_no_sigma_keeps_is_named():
    agent, seen = made(0, (4,), "tanh", "clip", 1.0)
    perturbations = [p for p, _ in ask(SearchConfig(directions=2), 0)]
    with pytest.raises(UsageError, match=r"action_change_max is 1e-12"):
        capped_sigma(ActionChange(agent, seen).around(agent.theta), perturbations, 1e-12)
