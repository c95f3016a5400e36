"""Teachers do their task, stay within the limits, and are what a training's warm-up is made of."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.environments.upstream import upstream
from drs_core.errors import UsageError
from drs_core.training.teachers import TEACHERS, act
from tests.conftest import drs, refused

SMALL = {"learning_starts": 100, "batch_size": 8, "buffer_size": 500}
SIZES = {"PandaPush-v3": (18, 3), "PandaPickAndPlace-v3": (19, 4), "PandaSlide-v3": (18, 3)}


def returns(environment_id, action_of, episodes):
    env = upstream(environment_id)
    for seed in range(episodes):
        observation, _ = env.reset(seed=seed)
        total, done = 0.0, False
        while not done:
            observation, reward, _, done, info = env.step(action_of(observation))
            total += reward
        yield total, bool(info["is_success"])
    env.close()


def test_the_cube_is_carried_to_the_goal():
    teacher = TEACHERS["PandaPickAndPlace-v3"]
    outcomes = list(returns("PandaPickAndPlace-v3", lambda seen: teacher(seen).astype(np.float32), 20))
    assert all(success for _, success in outcomes) and np.mean([total for total, _ in outcomes]) > -15.0


def test_the_cube_is_pushed_to_the_goal():
    teacher = TEACHERS["PandaPush-v3"]
    outcomes = list(returns("PandaPush-v3", lambda seen: teacher(seen).astype(np.float32), 20))
    assert sum(success for _, success in outcomes) >= 14


def test_the_puck_comes_to_the_goal():
    teacher = TEACHERS["PandaSlide-v3"]
    outcomes = list(returns("PandaSlide-v3", lambda seen: teacher(seen).astype(np.float32), 20))
    assert sum(total > -50.0 for total, _ in outcomes) >= 14
    assert sum(success for _, success in outcomes) >= 12


def test_noise_leaves_the_task_possible_and_depends_on_seed_and_step_alone():
    teacher, steps = TEACHERS["PandaPickAndPlace-v3"], iter(range(1000))
    outcomes = list(returns("PandaPickAndPlace-v3", lambda seen: act(teacher, seen, 0, next(steps)), 20))
    assert sum(success for _, success in outcomes) >= 16
    seen = {"observation": np.zeros(20), "achieved_goal": np.ones(3), "desired_goal": np.ones(3)}
    first = [act(teacher, seen, 3, step) for step in range(20)]
    assert np.array_equal(first, [act(teacher, seen, 3, step) for step in range(20)])
    assert not np.array_equal(first, [act(teacher, seen, 4, step) for step in range(20)])


numbers = st.floats(-1e6, 1e6, width=32)


@pytest.mark.parametrize("environment_id", TEACHERS)
@given(data=st.data())
def test_an_action_is_finite_and_within_the_limits(environment_id, data):
    size, actions = SIZES[environment_id]
    vectors = {"observation": size, "achieved_goal": 3, "desired_goal": 3}
    seen = {
        name: np.array(data.draw(st.lists(numbers, min_size=length, max_size=length)), np.float32)
        for name, length in vectors.items()
    }
    action = TEACHERS[environment_id](seen)
    assert action.shape == (actions,) and np.all(np.abs(action) <= 1.0)


@pytest.mark.parametrize("environment_id", TEACHERS)
def test_the_warm_up_and_some_later_episodes_are_the_teachers(environment_id):
    pytest.importorskip("torch")
    from drs_core.training.config import TrainConfig
    from drs_core.training.model import make_learner

    learner = make_learner(TrainConfig("tqc", environment_id, seed=5, hidden=(4,), settings=SMALL))
    learner.model.learn(220)
    buffer = learner.model.replay_buffer
    teachers = [
        act(TEACHERS[environment_id], {name: rows[step, 0] for name, rows in buffer.observations.items()}, 5, step)
        for step in range(220)
    ]
    learner.close()
    by_teacher = [np.array_equal(action, taught) for action, taught in zip(buffer.actions[:220, 0], teachers)]
    assert all(by_teacher[:100]) and not any(by_teacher[150:200])
    # PandaSlide's also acts in every second episode that follows
    later = environment_id == "PandaSlide-v3"
    assert {*by_teacher[100:150], *by_teacher[200:]} == {later}


def test_a_teacher_where_there_is_none_is_refused(tmp_path):
    pytest.importorskip("torch")
    output = tmp_path / "x.safetensors"
    for algorithm, environment_id, words in (
        ("tqc", "PandaReach-v3", "There is no teacher for PandaReach-v3, only for PandaPush-v3, PandaPickAndPlace-v3"),
        ("ppo", "PandaSlide-v3", "PPO has no warm-up for a teacher"),
    ):
        refused(drs("train", algorithm, environment_id, "--teacher", "-o", output), words)
    assert not list(tmp_path.iterdir())


def test_only_a_teacher_makes_the_warm_up_long():
    from drs_core.training.recipes import recipe

    taught, untaught = (recipe("tqc", "PandaPush-v3", teacher) for teacher in (None, False))
    assert taught == recipe("tqc", "PandaPush-v3", True) and taught.teacher and not untaught.teacher
    assert taught.settings["learning_starts"] == 20_000
    # as on PandaReach, which has none
    assert untaught.settings["learning_starts"] == recipe("tqc", "PandaReach-v3").settings["learning_starts"] == 1000
    assert not recipe("ppo", "PandaPush-v3").teacher


def test_how_long_an_actor_imitates_is_part_of_what_a_training_says_of_itself():
    from drs_core.training.config import TrainConfig

    said = {name: TrainConfig("tqc", name).record() for name in TEACHERS}
    assert {name: record["imitate"] for name, record in said.items() if record["imitate"]} == {"PandaSlide-v3": 200_000}
    assert said["PandaSlide-v3"]["teach_every"] == 2 and said["PandaPush-v3"]["teach_every"] == 0
    assert not TrainConfig("tqc", "PandaSlide-v3", teacher=False).record()["imitate"]


def test_a_training_goes_on_with_the_teacher_it_had(tmp_path):
    pytest.importorskip("torch")
    from drs_core.training.config import TrainConfig
    from drs_core.training.train import train

    def said(_text):
        pass

    slide = TrainConfig("tqc", "PandaSlide-v3", steps=100, hidden=(4,), evaluate_every=100, episodes=1, settings=SMALL)
    train(slide, tmp_path / "slide", said)
    with pytest.raises(UsageError, match="begun with teacher = True, not False"):
        train(replace(slide, teacher=False), tmp_path / "slide", said, resume=True)

    reach = replace(slide, environment="PandaReach-v3")
    train(reach, tmp_path / "reach", said)
    path = tmp_path / "reach" / "training.json"
    record = json.loads(path.read_text())
    del record["settings"]["teacher"]  # as a training of an earlier version
    path.write_text(json.dumps(record))
    assert train(replace(reach, steps=150), tmp_path / "reach", said, resume=True).finished
