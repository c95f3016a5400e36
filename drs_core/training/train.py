"""Train a baseline with Stable-Baselines3 and bring it through the importer, like anybody's agent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drs_core.agent import Agent
from drs_core.environments import Environment, current_name, describe, quiet
from drs_core.errors import DrsError, UsageError, shown
from drs_core.evaluation import evaluate, summary
from drs_core.importing import Hints, import_agent
from drs_core.rollouts import InProcess
from drs_core.training.recipes import Recipe, recipe

EVALUATION_SEED = 1_000_000
"""Evaluation in training uses seeds of its own, so that seed 0 stays fresh."""
_FIRST_LOOK_EPISODES = 10

Say = Callable[[str], None]


@dataclass(frozen=True)
class TrainConfig:
    """What to train; None where the recipe decides.

    Attributes:
        algorithm: one of the six.
        environment: gymnasium id.
        steps: environment steps, at most.
        seed: of everything.
        hidden: units of the hidden layers.
        time_feature: whether the policy observes the remaining time.
        evaluate_every: steps between evaluations.
        episodes: episodes of an evaluation.
        stop_at_success: end at the first evaluation with this success in percent.
    """

    algorithm: str
    environment: str
    steps: int | None = None
    seed: int = 0
    hidden: tuple[int, ...] | None = None
    time_feature: bool | None = None
    evaluate_every: int = 2000
    episodes: int = 100
    stop_at_success: float | None = None

    def __post_init__(self) -> None:
        """Raise UsageError with the name, value and range of a setting that is not allowed."""
        for name, value in (
            ("steps", self.steps),
            ("evaluate_every", self.evaluate_every),
            ("episodes", self.episodes),
        ):
            if value is not None and not 1 <= value <= 10**9:
                raise UsageError(f"{name} is {value}; allowed are 1 to 1e9.")
        if self.hidden is not None and not (self.hidden and all(1 <= units <= 4096 for units in self.hidden)):
            raise UsageError(f"hidden is {shown(self.hidden)}; allowed are one or more layers of 1 to 4096 units.")
        if not 0 <= self.seed < 2**31:
            raise UsageError(f"seed is {self.seed}; allowed are 0 to 2^31 - 1.")
        if self.stop_at_success is not None and not 0.0 < self.stop_at_success <= 100.0:
            raise UsageError(f"stop_at_success is {self.stop_at_success}; allowed are more than 0, to 100 percent.")

    def recipe(self) -> Recipe:
        """The recipe with what this configuration decides."""
        chosen = recipe(self.algorithm, self.environment)
        given: dict[str, Any] = {"steps": self.steps, "hidden": self.hidden, "time_feature": self.time_feature}
        return replace(chosen, **{name: value for name, value in given.items() if value is not None})


def train(config: TrainConfig, say: Say) -> Agent:
    """Train, evaluating now and then; returns the last agent evaluated, also when interrupted after one.

    Raises:
        UsageError: algorithm, environment or a setting is not allowed.
        DrsError: PyTorch or Stable-Baselines3 is not installed.
    """
    config = replace(config, environment=current_name(config.environment))
    describe(config.environment)
    model = _model(config)
    started, agent = time.perf_counter(), None
    most = config.recipe().steps
    with TemporaryDirectory() as folder, _kept_when_interrupted(lambda: agent is not None, say):
        while model.num_timesteps < most:
            # the first call resets the counters, the others continue
            count = min(config.evaluate_every, most - model.num_timesteps)
            model.learn(count, reset_num_timesteps=model.num_timesteps == 0)
            agent = _as_agent(model, config, Path(folder))
            result = _evaluate(agent, config)
            success = result["success_percent"]
            say(
                f"{model.num_timesteps} steps, {time.perf_counter() - started:.0f} s: "
                f"return {result['return_mean']:.2f} +- {result['return_std']:.2f} in {result['episodes']} episodes"
                + ("" if success is None else f", success {success:.0f} %")
            )
            enough = config.stop_at_success is not None and (success or 0.0) >= config.stop_at_success
            if enough and result["episodes"] == config.episodes:
                break
    assert agent is not None
    return agent


@contextmanager
def _kept_when_interrupted(anything: Callable[[], bool], say: Say) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        if not anything():
            raise
        say("Interrupted; the last agent evaluated is kept.")


def _evaluate(agent: Agent, config: TrainConfig) -> dict[str, Any]:
    rollouts = InProcess(agent)
    try:
        first = summary(evaluate("", agent, rollouts, min(_FIRST_LOOK_EPISODES, config.episodes), EVALUATION_SEED))
        wanted = config.stop_at_success
        if wanted is None or (first["success_percent"] or 0.0) < wanted:
            return first
        return summary(evaluate("", agent, rollouts, config.episodes, EVALUATION_SEED))
    finally:
        rollouts.close()


def _as_agent(model: Any, config: TrainConfig, folder: Path) -> Agent:
    zip_file, normaliser = folder / "model.zip", folder / "vecnormalize.pkl"
    model.save(zip_file)
    normalised = model.get_vec_normalize_env()
    if normalised is not None:
        normalised.save(str(normaliser))
    agent = import_agent(
        str(zip_file),
        Hints(
            environment=config.environment,
            algorithm=config.algorithm,
            normaliser=normaliser if normalised is not None else None,
            time_feature=config.recipe().time_feature,
        ),
    )
    # the zip was a temporary one: its name and sha256 would say nothing
    source = {name: agent.source[name] for name in ("algorithm", "stable_baselines3")}
    return replace(
        agent, source={**source, "trained_by": "drs train", "seed": config.seed, "steps": int(model.num_timesteps)}
    )


def _model(config: TrainConfig) -> Any:
    try:
        import sb3_contrib
        import stable_baselines3
        import torch
        from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
    except ModuleNotFoundError as error:
        raise DrsError(f"Training needs {error.name}; install it with: pip install 'drs[train]'.") from error
    chosen = config.recipe()
    # small networks: one thread is faster than two, and leaves the other core alone
    torch.set_num_threads(1)
    classes = {**vars(stable_baselines3), "TQC": sb3_contrib.TQC}
    with quiet():
        env: Any = DummyVecEnv([lambda: _environment(config.environment, chosen, config.seed)])
    if chosen.normalise:
        env = VecNormalize(env, norm_reward=False)
    settings = dict(chosen.settings)
    if chosen.hindsight:
        settings["replay_buffer_class"] = stable_baselines3.HerReplayBuffer
        settings["replay_buffer_kwargs"] = {"goal_selection_strategy": "future", "n_sampled_goal": 4}
    is_dict = isinstance(env.observation_space.spaces, dict) if hasattr(env.observation_space, "spaces") else False
    return classes[config.algorithm.upper()](
        "MultiInputPolicy" if is_dict else "MlpPolicy",
        env,
        policy_kwargs={"net_arch": list(chosen.hidden)},
        seed=config.seed,
        device="cpu",
        **settings,
    )


def _environment(environment_id: str, chosen: Recipe, seed: int) -> Any:
    import gymnasium
    from sb3_contrib.common.wrappers import TimeFeatureWrapper
    from stable_baselines3.common.monitor import Monitor

    class RunOn(gymnasium.Wrapper[Any, Any, Any, Any]):
        """Panda to its time limit, as in evaluation; every episode from a seed of this run."""

        def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
            # panda-gym draws a seed from the machine where none is given
            return self.env.reset(seed=int(seeds.integers(2**31)) if seed is None else seed, options=options)

        def step(self, action: Any) -> Any:
            observation, reward, terminated, truncated, info = self.env.step(action)
            return observation, reward, terminated and not environment_id.startswith("Panda"), truncated, info

    seeds = np.random.default_rng(seed)
    Environment(environment_id).close()  # registers the id
    env: Any = RunOn(gymnasium.make(environment_id, disable_env_checker=True))
    if chosen.time_feature:
        env = TimeFeatureWrapper(env)
    return Monitor(env)
