"""Looking at an episode changes nothing of it."""

from dataclasses import replace

import numpy as np
import pytest

from drs_core.accelerator import choose
from drs_core.environments.camera import camera
from drs_core.environments.environment import Environment
from drs_core.episode import ACTIONS, EpisodeRunner
from drs_core.errors import DrsError
from drs_core.report.film import Take, every_steps, film
from drs_core.rollouts import InProcess, Task
from tests.conftest import make_agent


def observations(environment_id, actions, seed, visible):
    environment = Environment(environment_id, visible=visible)
    seen, pictures = [environment.reset(seed)], []
    look = camera(environment, 64, 48) if visible else None
    for count, action in enumerate(actions):
        if look and count % 8 == 0:
            pictures.append(look().image)
        seen.append(environment.step(action).observation)
    environment.close()
    return [np.concatenate([*part.values()]) if isinstance(part, dict) else part.copy() for part in seen], pictures


@pytest.mark.parametrize(
    "environment_id", ["PandaReach-v3", "PandaPush-v3", "HopperBulletEnv-v0", "LunarLanderContinuous-v3",
                       "BipedalWalker-v3", "MountainCarContinuous-v0"]
)  # fmt: skip
def test_looking_changes_no_bit_of_an_episode(environment_id):
    spaces = make_agent(environment_id)
    actions = np.random.default_rng(1).uniform(spaces.low, spaces.high, (30, len(spaces.low))).astype(np.float32)
    seen, pictures = observations(environment_id, actions, 5, visible=True)
    unseen, _ = observations(environment_id, actions, 5, visible=False)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(seen, unseen, strict=True))
    assert all(picture.shape == (48, 64, 3) and picture.std() > 3 for picture in pictures)
    assert any((picture != pictures[0]).any() for picture in pictures)


def recorded(agent, seed=3, backend="python"):
    rollouts = InProcess(agent, backend)
    episode = rollouts.run(agent.theta, [Task(seed, frozenset({ACTIONS}))])[0]
    rollouts.close()
    return episode


def test_actions_are_recorded_only_when_asked_for_and_are_ones_own():
    agent = make_agent()
    runner = EpisodeRunner(agent)
    runner.load(agent.theta)
    first = runner.run(3, frozenset({ACTIONS}))
    kept = first.actions.copy()
    assert runner.run(4).actions is None
    assert first.actions.shape == (first.length, 1) and (first.actions == kept).all()
    runner.close()


def test_a_film_of_the_compiled_helper_shows_its_very_episode():
    agent = make_agent("HopperBulletEnv-v0")
    if choose("compiled", agent) != "compiled":
        pytest.skip("the accelerator is not built here")
    episode = recorded(agent, backend="compiled")
    clip = film(Take(agent.environment, episode, every=4))
    assert len(clip.frames) == 2 + (episode.length - 1) // 4 and clip.tips[0] is None


def test_a_film_of_another_episode_is_refused():
    agent = make_agent("HopperBulletEnv-v0")
    episode = recorded(agent)
    with pytest.raises(DrsError, match="another episode"):
        film(Take(agent.environment, replace(episode, return_=episode.return_ + 1.0), every=1000))


@pytest.mark.parametrize(
    ("step_s", "steps", "every"),
    [(0.04, 50, 1), (0.0165, 500, 3), (0.0165, 1000, 3), (0.02, 1600, 4), (1 / 30, 100, 1)],
)
def test_a_film_is_fluid_and_no_larger_than_a_page_can_carry(step_s, steps, every):
    assert every_steps(step_s, steps) == every
