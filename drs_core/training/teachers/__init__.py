"""Scripted controllers that act in place of chance while a training warms up.

Where a task is done by a sequence that random actions hardly ever find, such as grasping, hindsight has
nothing to learn from for hundreds of thousands of steps. A rough controller finds it at once; what the
policy learns from it and beyond it is the algorithm's own. A teacher sees what the policy sees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.training.teachers.actions import Teacher
from drs_core.training.teachers.imitation import imitating
from drs_core.training.teachers.pick_and_place import pick_and_place
from drs_core.training.teachers.push import push
from drs_core.training.teachers.slide import slide

TEACHERS: dict[str, Teacher] = {
    "PandaPush-v3": push,
    "PandaPickAndPlace-v3": pick_and_place,
    "PandaSlide-v3": slide,
}

# as many steps without noise as with; with it, the data hold ways back to the teacher's path
_NOISE = (0.0, 0.0, 0.1, 0.2)


def act(teacher: Teacher, observation: Mapping[str, NDArray[Any]], seed: int, step: int) -> NDArray[np.float32]:
    """The teacher's action with noise, within [-1, 1]; the noise of a step depends on `seed` and `step` alone."""
    rng = np.random.default_rng([seed, step])
    action = teacher(observation)
    noisy = np.clip(action + rng.choice(_NOISE) * rng.standard_normal(action.shape), -1.0, 1.0)
    return np.asarray(noisy, np.float32)


def taught(algorithm: Any, environment_id: str, seed: int, every: int = 0, imitate: int = 0) -> Any:
    """The class of an algorithm whose first `learning_starts` steps are acted by the teacher.

    Then it acts in every `every`-th episode, if not 0, and the actor imitates it for the first `imitate` steps.

    Raises:
        UsageError: the environment has no teacher, or the algorithm no warm-up.
    """
    if environment_id not in TEACHERS:
        raise UsageError(f"There is no teacher for {environment_id}, only for {', '.join(TEACHERS)}; leave it out.")
    if not hasattr(algorithm, "_sample_action"):
        raise UsageError(
            f"{algorithm.__name__} has no warm-up for a teacher; leave it out, or take DDPG, TD3, SAC or TQC."
        )

    teacher = TEACHERS[environment_id]
    if imitate:
        algorithm = imitating(algorithm, teacher, imitate)

    class Taught(algorithm):
        def _sample_action(self, learning_starts: int, action_noise: Any = None, n_envs: int = 1) -> Any:
            later = self.num_timesteps >= learning_starts
            if later and (not every or self._episode_num % every):
                return super()._sample_action(learning_starts, action_noise, n_envs)
            normaliser = self.get_vec_normalize_env()
            batch = self._last_obs if normaliser is None else normaliser.get_original_obs()
            observation = {name: values[0] for name, values in batch.items()}
            action = act(teacher, observation, seed, self.num_timesteps)[None]
            # actions lie in [-1, 1] here, as the replay buffer has them
            return action, action

    return Taught
