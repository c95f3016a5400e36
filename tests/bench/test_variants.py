"""Peers run the agent that we run: same actions, same number of steps; and who is missing is said to be."""

import sys

import numpy as np
import pytest

from drs_core.bench.agents import Size, bench_agent, random_agent, size_of
from drs_core.bench.processes import cpu_seconds, resident_mb, together
from drs_core.bench.variants import Absent, chosen
from drs_core.environments import PAPER, Environment
from drs_core.errors import UsageError
from drs_core.observation import MAIN

SMALL = Size((16, 8), "relu", "tanh", last_layer=1.0)
CASES = [
    ("MountainCarContinuous-v0", None),
    ("LunarLanderContinuous-v3", SMALL),
    ("HopperBulletEnv-v0", Size((16, 16), last_layer=1.0)),
    ("PandaReach-v3", SMALL),
]


def observations(agent, count=5):
    """Raw observations and the features that our policy gets from them, at step 0."""
    environment, assembler = Environment(agent.environment), agent.assembler()
    raw = [environment.reset(seed) for seed in range(count)]
    environment.close()
    return raw, [assembler.features(observation, 0) for observation in raw]


def with_time(agent, observation):
    """As the time feature wrapper gives it before the first step."""
    if agent.pipeline.time_limit_steps is None:
        return observation
    if isinstance(observation, dict):
        return observation | {MAIN: np.append(observation[MAIN], np.float32(1.0))}
    return np.append(observation, np.float32(1.0))


@pytest.mark.parametrize(("environment", "size"), CASES)
def test_stable_baselines_predicts_our_actions(environment, size):
    from drs_core.bench.variants.authors import Authors

    agent = random_agent(environment, size)
    variant, policy = Authors(agent), agent.policy()
    raw, features = observations(agent)
    for observation, seen in zip(raw, features, strict=True):
        timed = with_time(agent, observation)
        batch = {key: part[None] for key, part in timed.items()} if isinstance(timed, dict) else timed[None]
        action, _ = variant.model.predict(variant._env.normalize_obs(batch), deterministic=True)
        np.testing.assert_allclose(action[0], policy.act(seen), atol=2e-5)
    variant.close()


@pytest.mark.parametrize("algorithm", ["a2c", "ppo", "ddpg", "td3", "sac", "tqc"])
@pytest.mark.parametrize("gsde", [False, True])
def test_weights_land_in_every_algorithm(algorithm, gsde):
    import dataclasses

    from drs_core.bench.variants.authors import Authors

    squashed = algorithm not in ("a2c", "ppo")
    if gsde and algorithm not in ("sac", "tqc"):
        pytest.skip("it has no clipped mean")
    agent = random_agent("MountainCarContinuous-v0", SMALL if squashed else Size((16, 8), last_layer=1.0))
    network = dataclasses.replace(agent.network, mean_clip=2.0 if gsde else None)
    agent = dataclasses.replace(agent, network=network, source={"algorithm": algorithm}, theta=3.0 * agent.theta)
    variant, (raw, features) = Authors(agent), observations(agent)
    for observation, seen in zip(raw, features, strict=True):
        action, _ = variant.model.predict(variant._env.normalize_obs(observation[None]), deterministic=True)
        np.testing.assert_allclose(action[0], agent.policy().act(seen), atol=2e-5)
    variant.close()


@pytest.mark.parametrize(("environment", "size"), CASES)
def test_ars_predicts_our_actions(environment, size):
    from drs_core.bench.variants.ars import Ars

    agent = random_agent(environment, size)
    variant = Ars(agent)
    variant._ars.policy.load_from_vector(variant._weights)
    for seen in observations(agent)[1]:
        action, _ = variant._ars.policy.predict(seen)
        np.testing.assert_allclose(action, agent.policy().act(seen), atol=2e-5)
    variant.close()


@pytest.mark.parametrize(("environment", "size"), CASES)
def test_gymne_gives_our_actions(environment, size):
    torch = pytest.importorskip("torch")
    pytest.importorskip("evotorch", reason="EvoTorch is not installed: pip install -c constraints.txt -e '.[peers]'")
    from drs_core.bench.variants.gymne import GymNe

    agent = random_agent(environment, size)
    variant = GymNe(agent)
    policy = variant._problem.to_policy(variant._batch.values[0])
    raw, features = observations(agent)
    for observation, seen in zip(raw, features, strict=True):
        timed = with_time(agent, observation)
        if isinstance(timed, dict):
            timed = np.concatenate([timed[part.key] for part in agent.pipeline.parts])
        action = policy(torch.as_tensor(timed, dtype=torch.float32)).detach().numpy()
        np.testing.assert_allclose(action, agent.policy().act(seen), atol=2e-5)
    variant.close()


@pytest.mark.parametrize("name", ["authors", "ars", "evotorch", "python"])
def test_panda_runs_its_fifty_steps_in_every_variant(name):
    # the shipped agent reaches its goal long before
    try:
        variant = chosen((name,))[name].make(bench_agent("PandaReach-v3", None))
    except Absent as error:
        pytest.skip(str(error))
    sample = variant.run(seed=0, steps=60)
    variant.close()
    assert (sample.steps, sample.rollouts) == (100, 2)
    assert 0 < sample.cpu_s and 0 < sample.wall_s


@pytest.mark.parametrize("name", ["authors", "ars", "evotorch", "python", "workers_1"])
def test_the_same_seed_gives_the_same_episode_again(name):
    """The lander's episodes end when it touches the ground: another seed, another length."""
    try:
        variant = chosen((name,))[name].make(random_agent("LunarLanderContinuous-v3"))
    except Absent as error:
        pytest.skip(str(error))
    lengths = []
    for seed in (3, 4, 3):
        sample = variant.run(seed, 1)
        lengths.append(sample.steps / sample.rollouts)
    variant.close()
    assert lengths[0] == lengths[2] != lengths[1]


@pytest.mark.parametrize(
    "environment", ["HopperBulletEnv-v0", "PandaReach-v3", "LunarLanderContinuous-v3", "BipedalWalker-v3"]
)
def test_physics_alone_is_cheaper_than_the_environment(environment):
    agent = random_agent(environment)
    physics, ours = (chosen((name,))[name].make(agent) for name in ("physics", "python"))
    ours.run(0, 1)
    # neighbours in time, since whoever else is on the processor makes both dearer
    costs = [[variant.run(0, 50) for variant in (physics, ours)] for _ in range(15)]
    physics.close()
    ours.close()
    assert costs[0][0].steps == 50
    ratios = [alone.cpu_us_per_step / whole.cpu_us_per_step for alone, whole in costs]
    assert 0 < np.median(ratios) < 1


def test_who_is_not_installed_is_absent(monkeypatch):
    for name in ("evotorch", "evotorch.neuroevolution"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "drs_core.bench.variants.gymne", raising=False)
    with pytest.raises(Absent, match=r"needs evotorch; .*\.\[peers\]"):
        chosen(("evotorch",))["evotorch"].make(random_agent("MountainCarContinuous-v0"))


def test_without_a_workspace_ros_is_absent(monkeypatch, tmp_path):
    import drs_core.graph

    monkeypatch.setattr(drs_core.graph, "_CHECKOUT", tmp_path)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    with pytest.raises(Absent, match="not built"):
        chosen(("ros",))["ros"].make(random_agent("MountainCarContinuous-v0"))


def test_mountain_car_has_no_physics():
    with pytest.raises(Absent, match="without a physics engine"):
        chosen(("physics",))["physics"].make(random_agent("MountainCarContinuous-v0"))


def test_an_unknown_variant_is_refused():
    with pytest.raises(UsageError, match="no variant 'warp'"):
        chosen(("python", "warp"))


def test_agents_come_from_the_zoo_where_it_has_one(shared):
    agents = {name: bench_agent(name, shared / "agents") for name in PAPER}
    assert all(agent.environment == name for name, agent in agents.items())
    random = {name for name, agent in agents.items() if agent.source.get("weights") == "random"}
    assert {"HopperBulletEnv-v0", "BipedalWalkerHardcore-v3", "PandaReach-v3"}.isdisjoint(random)
    for name in random:
        assert agents[name].network.sizes[1:-1] == size_of(name).hidden


def test_cpu_time_and_memory_of_a_process_are_read():
    import os

    before = cpu_seconds(os.getpid())
    assert sum(range(300_000)) > 0
    assert cpu_seconds(os.getpid()) > before
    assert together([os.getpid()]) > before
    assert 5 < resident_mb(os.getpid()) < 50_000
    with pytest.raises(ProcessLookupError):
        cpu_seconds(2**22 - 7)
