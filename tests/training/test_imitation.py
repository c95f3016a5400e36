"""An actor imitates its teacher for as long as it is told to, and not after; its optimiser is part of the state."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")

from sb3_contrib import TQC  # noqa: E402
from stable_baselines3 import TD3, HerReplayBuffer  # noqa: E402

from drs_core.environments.upstream import upstream  # noqa: E402
from drs_core.training.teachers import TEACHERS  # noqa: E402
from drs_core.training.teachers.imitation import imitating  # noqa: E402

FROM, STEPS = 100, 200


def toward_the_goal(observation):
    """A teacher that a small network learns at once."""
    return np.clip(5.0 * (observation["desired_goal"] - observation["achieved_goal"]), -1.0, 1.0)


def learner(algorithm, steps=STEPS, teacher=toward_the_goal, rows=1000):
    return imitating(algorithm, teacher, steps)(
        "MultiInputPolicy", upstream("PandaReach-v3"), learning_starts=FROM, batch_size=16, buffer_size=rows,
        replay_buffer_class=HerReplayBuffer, policy_kwargs={"net_arch": [16]}, learning_rate=3e-3, train_freq=1, seed=3,
    )  # fmt: skip


def unlike(model):
    """Root mean square of what divides the actor from its teacher, in what was seen."""
    seen = {name: rows[:FROM, 0] for name, rows in model.replay_buffer.observations.items()}
    wanted = [toward_the_goal({name: rows[i] for name, rows in seen.items()}) for i in range(FROM)]
    return np.sqrt(np.square(model.predict(seen, deterministic=True)[0] - wanted).mean())


def parts(model, name):
    return [parameter.detach().clone() for parameter in getattr(model, name).parameters()]


def same(some, others):
    return all(torch.equal(one, other) for one, other in zip(some, others, strict=True))


@pytest.mark.parametrize("algorithm", [TQC, TD3])
def test_the_actor_becomes_like_its_teacher_while_the_critic_learns(algorithm):
    model = learner(algorithm)
    model.learn(FROM)
    before, critic = unlike(model), parts(model, "critic")
    model.learn(STEPS - FROM, reset_num_timesteps=False)
    assert unlike(model) < 0.5 * before and not same(critic, parts(model, "critic"))
    if algorithm is TQC:
        seen = model.policy.obs_to_tensor({name: rows[0] for name, rows in model.replay_buffer.observations.items()})[0]
        assert model.actor.get_action_dist_params(seen)[1].exp().max() < 0.3


def test_nothing_else_moves_the_actor_then_and_the_algorithm_alone_after():
    def none(observation):
        raise AssertionError("the teacher is asked")

    model = learner(TQC, teacher=none)
    model._imitate = lambda: None
    model.learn(FROM)
    actor = parts(model, "actor")
    model.learn(50, reset_num_timesteps=False)
    assert same(actor, parts(model, "actor"))
    model = learner(TQC, steps=0, teacher=none)
    model.learn(FROM + 20)
    assert not same(actor, parts(model, "actor"))


def test_the_teacher_is_asked_once_for_what_was_seen_and_again_where_it_was_replaced():
    asked = []

    def counted(observation):
        asked.append(None)
        return toward_the_goal(observation)

    model = learner(TQC, teacher=counted, rows=150)
    model.learn(STEPS)
    # seen while it imitated; a batch is larger than the buffer
    assert 150 <= len(asked) <= STEPS
    buffer, every = model.replay_buffer, np.arange(150)
    assert buffer.full
    seen = {name: rows[:, 0] for name, rows in buffer.observations.items()}
    assert np.allclose(model._shown(every, seen), toward_the_goal(seen))


def test_its_step_falls_to_nothing_until_it_ends():
    model, steps = learner(TQC), []
    imitate = model._imitate
    model._imitate = lambda: (steps.append(model.imitation.param_groups[0]["lr"]), imitate())
    model.learn(STEPS + 20)
    assert steps == sorted(steps, reverse=True) and len(steps) == 4 * (STEPS - FROM)
    assert steps[0] == pytest.approx(3e-3 * 0.99) and steps[-5] == pytest.approx(3e-3 * 0.01) and steps[-1] == 0.0


def test_its_optimiser_comes_back_with_the_state():
    model = learner(TQC)
    model.learn(FROM + 20)
    other = learner(TQC)
    other.set_parameters(model.get_parameters(), exact_match=True)
    state, kept = (m.imitation.state_dict()["state"] for m in (model, other))
    assert state and all(torch.equal(state[i]["exp_avg"], kept[i]["exp_avg"]) for i in state)


def test_a_recipe_says_which_tasks_are_imitated():
    from drs_core.training.config import TrainConfig
    from drs_core.training.model import make_learner

    small = {"learning_starts": 100, "batch_size": 8, "buffer_size": 500}
    for environment_id in TEACHERS:
        made = make_learner(TrainConfig("tqc", environment_id, seed=5, hidden=(4,), settings=small))
        assert hasattr(made.model, "imitation") == (environment_id == "PandaSlide-v3")
        made.close()
