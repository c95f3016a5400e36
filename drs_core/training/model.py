"""The Stable-Baselines3 model of a configuration, with its environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from drs_core.environments import quiet
from drs_core.errors import DrsError, UsageError, install
from drs_core.training.config import TrainConfig
from drs_core.training.recipes import Recipe
from drs_core.training.teachers import taught


@dataclass
class LinearDecay:
    """A learning rate that falls to 0 over the whole training.

    Stable-Baselines3 offers the progress within one call of ``learn``; a training is many of them.
    """

    rate: float
    steps: int
    done: int = 0

    def __call__(self, _progress_remaining: float) -> float:
        """The learning rate after `done` steps."""
        return self.rate * max(0.0, 1.0 - self.done / self.steps)


@dataclass
class Learner:
    """A model and what decides its next step beside it.

    Attributes:
        model: of Stable-Baselines3 or sb3-contrib.
        episode_seeds: where the seed of each training episode is drawn from.
        decay: the schedule of the learning rate, where it has one.
    """

    model: Any
    episode_seeds: np.random.Generator
    decay: LinearDecay | None

    def tell_progress(self) -> None:
        """Let the learning rate follow the steps done."""
        if self.decay is not None:
            self.decay.done = self.model.num_timesteps

    def close(self) -> None:
        """Free the simulator."""
        self.model.get_env().close()


def make_learner(config: TrainConfig) -> Learner:
    """The untrained model of a configuration.

    Raises:
        UsageError: the algorithm does not take a setting.
        DrsError: PyTorch or Stable-Baselines3 is not installed.
    """
    try:
        import sb3_contrib
        import stable_baselines3
        import torch
        from stable_baselines3.common.logger import Logger
        from stable_baselines3.common.noise import NormalActionNoise
        from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
    except ModuleNotFoundError as error:
        raise DrsError(f"Training needs {error.name}; {install('train')}.") from error
    chosen = config.recipe()
    # small networks: one thread is faster than two, and leaves the other core alone
    torch.set_num_threads(1)
    classes = {**vars(stable_baselines3), "TQC": sb3_contrib.TQC}
    algorithm = classes[config.algorithm.upper()]
    if chosen.teacher:
        algorithm = taught(algorithm, config.environment, config.seed, chosen.teach_every, chosen.imitate)
    seeds = np.random.default_rng(config.seed)
    with quiet():
        env: Any = DummyVecEnv([lambda: _environment(config.environment, chosen, seeds)])
    if chosen.normalise:
        env = VecNormalize(env, norm_reward=False)
    settings = dict(chosen.settings)
    decay = LinearDecay(settings["learning_rate"], chosen.steps) if chosen.decay else None
    if decay is not None:
        settings["learning_rate"] = decay
    if chosen.hindsight:
        settings["replay_buffer_class"] = stable_baselines3.HerReplayBuffer
        settings["replay_buffer_kwargs"] = {"goal_selection_strategy": "future", "n_sampled_goal": 4}
    if chosen.noise:
        actions = env.action_space.shape
        settings["action_noise"] = NormalActionNoise(np.zeros(actions), np.full(actions, chosen.noise))
    is_dict = isinstance(env.observation_space.spaces, dict) if hasattr(env.observation_space, "spaces") else False
    try:
        model = algorithm(
            "MultiInputPolicy" if is_dict else "MlpPolicy",
            env,
            policy_kwargs={"net_arch": list(chosen.hidden), **chosen.policy},
            seed=config.seed,
            device="cpu",
            **settings,
        )
    except (TypeError, ValueError, AssertionError) as error:
        if not config.settings:
            raise
        env.close()
        raise UsageError(f"{config.algorithm} does not take the settings {dict(config.settings)}: {error}.") from error
    # the default one leaves an empty folder in the temporary directory, one for every look at the agent
    model.set_logger(Logger(folder=None, output_formats=[]))
    return Learner(model, seeds, decay)


def _environment(environment_id: str, chosen: Recipe, seeds: np.random.Generator) -> Any:
    import gymnasium
    from sb3_contrib.common.wrappers import TimeFeatureWrapper
    from stable_baselines3.common.monitor import Monitor

    from drs_core.environments.upstream import upstream

    class Seeded(gymnasium.Wrapper[Any, Any, Any, Any]):
        """Every episode from a seed of this training: panda-gym draws one from the machine where none is given."""

        def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
            # PyBullet's walkers make their client, which prints, at the first reset
            with quiet():
                return self.env.reset(seed=int(seeds.integers(2**31)) if seed is None else seed, options=options)

    env: Any = Seeded(upstream(environment_id))
    if chosen.time_feature:
        env = TimeFeatureWrapper(env)
    return Monitor(env)
