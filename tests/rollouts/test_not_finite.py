"""An action that is not finite is refused before it reaches a simulator, and what broke an episode reaches no other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from drs_core.agent import Agent
from drs_core.environments import PAPER, Environment, describe
from drs_core.episode import ACTIONS, EpisodeRunner
from drs_core.errors import DrsError
from drs_core.observation import Part, Pipeline
from drs_core.policy import Network
from drs_core.rollouts import InProcess, ProcessPool, Task
from tests.conftest import drs, make_agent, refused
from tests.rollouts.test_pool import facts

TASKS = [Task(seed, frozenset({ACTIONS})) for seed in (1, 2)]
REFUSED = "the policy gave an action that is not finite"


def overflowing(environment: str) -> Agent:
    """Every weight is finite, and so is the file; the layers' product is not."""
    spaces = describe(environment)
    pipeline = Pipeline(tuple(Part(key, size) for key, size in spaces.parts.items()), spaces.is_dict)
    network = Network((pipeline.size, *[2] * 10, len(spaces.low)), "relu", "clip")
    theta = np.zeros(network.parameters, np.float32)
    layers = network.layers(theta)
    layers[0][1][:] = 3e38
    for weight, _ in layers[1:-1]:
        weight[:] = 3e38
    layers[-1][0][0] = (0.01, -0.01)
    return Agent(environment, pipeline, network, spaces.low, spaces.high, theta)


@pytest.mark.parametrize("backend", ["python", "plain"])
@pytest.mark.parametrize("environment", PAPER)
def test_it_is_refused_and_the_next_episodes_are_as_ever(environment: str, backend: str) -> None:
    agent = make_agent(environment)
    rollouts = InProcess(agent, backend)
    expected = facts(rollouts.run(agent.theta, TASKS))
    with pytest.raises(DrsError, match=f"with seed 1: {REFUSED}"):
        rollouts.run(np.full_like(agent.theta, np.nan), TASKS)
    assert facts(rollouts.run(agent.theta, TASKS)) == expected
    rollouts.close()


@contextmanager
def poison(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Episodes that leave a state in the simulator that nothing mends, and fail."""

    def run(runner: EpisodeRunner, seed: int, measure: frozenset[str]) -> None:
        runner.environment.reset(seed)
        runner.environment.step(np.full(len(runner.environment.spaces.low), np.nan, np.float32))
        raise RuntimeError("the simulator fell over")

    with monkeypatch.context() as patched:
        patched.setattr(EpisodeRunner, "run", run)
        with pytest.raises(RuntimeError, match="fell over"):
            yield


@pytest.mark.parametrize("environment", ["PandaReach-v3", "PandaPush-v3"])
def test_where_an_episode_fails_the_simulator_is_made_anew(environment: str, monkeypatch: pytest.MonkeyPatch) -> None:
    agent = make_agent(environment)
    rollouts = InProcess(agent)
    expected = facts(rollouts.run(agent.theta, TASKS))
    with poison(monkeypatch):
        rollouts.run(agent.theta, TASKS)
    assert facts(rollouts.run(agent.theta, TASKS)) == expected
    rollouts.close()


def test_an_observation_that_is_not_finite_is_not_the_policys_doing(monkeypatch: pytest.MonkeyPatch) -> None:
    def reset(environment: Environment, seed: int) -> np.ndarray:
        return np.full(2, np.nan, np.float32)

    agent = make_agent()
    monkeypatch.setattr(Environment, "reset", reset)
    with pytest.raises(DrsError, match="gave a reward or observation that is not finite"):
        InProcess(agent).run(agent.theta, TASKS)


def test_a_pool_says_it_as_one_process_does() -> None:
    agent = overflowing("PandaReach-v3")
    with pytest.raises(DrsError) as here:
        InProcess(agent).run(agent.theta, TASKS[:1])
    with ProcessPool(agent, 1) as pool, pytest.raises(DrsError) as there:
        pool.run(agent.theta, TASKS[:1])
    assert str(there.value) == str(here.value) and REFUSED in str(here.value)


@pytest.mark.parametrize("environment", ["HopperBulletEnv-v0", "BipedalWalker-v3", "LunarLanderContinuous-v3"])
def test_the_command_line_says_it_in_a_sentence(environment: str, tmp_path: Path) -> None:
    agent = tmp_path / "agent.safetensors"
    overflowing(environment).save(agent)
    common = ("--backend", "python", "--workers", 1)
    refused(drs("evaluate", agent, "--episodes", 2, "--json", *common), REFUSED)
    small = ("--updates", 1, "--directions", 1, "--evaluate-every", 0)
    refused(drs("tune", agent, "--output", tmp_path / "run", *small, *common), REFUSED)
