"""Train a baseline with Stable-Baselines3 and bring it through the importer, like anybody's agent.

Evaluation decides which agent is the best; checkpoints are taken between two rollouts, where model,
replay buffer and counters agree with each other.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from drs_core.agent import Agent
from drs_core.environments import current_name, describe
from drs_core.errors import UsageError
from drs_core.files import lock_folder
from drs_core.importing import Hints, import_agent
from drs_core.training.checkpoint import Checkpoints
from drs_core.training.config import WHEN_TO_END, TrainConfig
from drs_core.training.folder import TrainingFolder
from drs_core.training.interrupts import Interrupts, Stopped
from drs_core.training.judging import judge, rank
from drs_core.training.model import Learner, make_learner

CHECKPOINT_MINUTES = 3.0
_KEPT_OF_EVALUATION = ("episodes", "seed", "success_percent", "return_mean", "return_std", "length_mean")

Say = Callable[[str], None]


@dataclass(frozen=True)
class Trained:
    """What a training came to.

    Attributes:
        agent: the best by evaluation; None where it was interrupted before the first one.
        finished: whether it was not interrupted.
    """

    agent: Agent | None
    finished: bool


def train(
    config: TrainConfig,
    path: Path,
    say: Say,
    *,
    resume: bool = False,
    checkpoint_minutes: float = CHECKPOINT_MINUTES,
) -> Trained:
    """Train in the folder `path`, evaluating now and then; the best agent by success, then return.

    Raises:
        UsageError: algorithm, environment or a setting is not allowed, or not that of the folder.
        DrsError: PyTorch or Stable-Baselines3 is not installed, or the folder cannot be written.
    """
    if not 0.0 < checkpoint_minutes <= 60.0:
        raise UsageError(f"checkpoint_minutes is {checkpoint_minutes}; allowed are more than 0, to 60.")
    config = replace(config, environment=current_name(config.environment))
    describe(config.environment)
    folder = TrainingFolder(path)
    begun = resume and folder.training_json.exists()
    # before the model is made, which takes seconds; the folder after it, where nothing else can be wrong
    if begun:
        # a learning rate that falls to 0 at the last step depends on where that is
        folder.check(config.record(), WHEN_TO_END[1:] if config.recipe().decay else WHEN_TO_END)
    else:
        folder.check_free()
    with closing(make_learner(config)) as learner:
        if not begun:
            folder.begin(config.record())
        with closing(lock_folder(path)):
            training = _Training(config, folder, learner, say, 60.0 * checkpoint_minutes)
            if begun:
                training.resume()
            return training.run()


class _Training:
    """One training at work."""

    def __init__(
        self, config: TrainConfig, folder: TrainingFolder, learner: Learner, say: Say, period_s: float
    ) -> None:
        self._config, self._recipe = config, config.recipe()
        self._folder, self._learner, self._say = folder, learner, say
        self._checkpoints = Checkpoints(folder, learner)
        self._period_s = period_s
        self._wall_before_s = 0.0
        self._started = self._saved = time.perf_counter()
        self._target = min(self._recipe.evaluate_every, self._recipe.steps)
        self._evaluated = 0
        self._ended_by: list[Any] | None = None
        self._interrupts = Interrupts()

    def resume(self) -> None:
        """Go back to the newest state that is whole."""
        numbers = self._folder.generations()
        for number in numbers:
            try:
                generation = self._folder.open(number)
            except UsageError as error:
                self._say(f"{error} The state before it is taken.")
                continue
            progress = self._checkpoints.restore(generation)
            self._wall_before_s = float(progress["wall_s"])
            self._target = min(int(progress["target"]), self._recipe.steps)
            self._evaluated, self._ended_by = int(progress["evaluated"]), progress["ended_by"]
            break
        else:
            if numbers:
                raise UsageError(f"No state in {self._folder.state} is whole; begin again in a new folder with --run.")
        self._folder.cut_back(self._evaluated)
        self._say(f"Resumed at {self._learner.model.num_timesteps} steps, {self._wall_s():.0f} s.")

    def run(self) -> Trained:
        """Learn and evaluate in turn until steps or success are reached, or somebody interrupts."""
        try:
            with self._interrupts:
                while self._ended_by != self._ends():
                    self._learn()
                    if self._evaluated_enough() or self._learner.model.num_timesteps >= self._recipe.steps:
                        self._ended_by = self._ends()
                    else:
                        self._next_target()
                        self._save_when_due()
                self._save()
            finished = True
        except Stopped:
            finished = False
            self._save()
            steps = self._learner.model.num_timesteps
            self._say(f"Stopped at {steps} steps, all kept in {self._folder.path}; continue with --resume.")
        return Trained(self._folder.best_agent(), finished)

    def _ends(self) -> list[Any]:
        return [self._recipe.steps, self._config.stop_at_success]

    def _learn(self) -> None:
        model = self._learner.model
        if self._ended_by is not None:
            # ended before, and now told to go on
            self._ended_by = None
            self._next_target()
        if model.num_timesteps < self._target:
            # the first call resets the counters, the others continue
            count = self._target - model.num_timesteps
            model.learn(count, callback=_between_rollouts(self._look_up), reset_num_timesteps=model.num_timesteps == 0)

    def _next_target(self) -> None:
        self._target = min(self._learner.model.num_timesteps + self._recipe.evaluate_every, self._recipe.steps)

    def _look_up(self) -> None:
        self._learner.tell_progress()
        self._interrupts.check()
        self._save_when_due()

    def _evaluated_enough(self) -> bool:
        model, wanted = self._learner.model, self._config.stop_at_success
        with TemporaryDirectory() as folder:
            agent = _as_agent(model, self._config, Path(folder))
        best_agent = self._folder.best_agent()
        best = None if best_agent is None else best_agent.source["evaluation"]
        result = judge(agent, best, self._recipe.episodes, wanted, lambda _done: self._interrupts.check())
        success, whole = result["success_percent"], result["episodes"] == self._recipe.episodes
        kept = {name: result[name] for name in _KEPT_OF_EVALUATION}
        wall_s = round(self._wall_s(), 1)
        agent = replace(agent, source={**agent.source, "wall_s": wall_s, "evaluation": kept})
        better = best is None or rank(kept) > rank(best)
        self._folder.record({"steps": int(model.num_timesteps), "wall_s": wall_s, **kept, "best": better})
        self._evaluated = int(model.num_timesteps)
        agent.save(self._folder.agent)
        if better:
            agent.save(self._folder.best)
        self._say(
            f"{model.num_timesteps} steps, {wall_s:.0f} s: "
            f"return {result['return_mean']:.2f} +- {result['return_std']:.2f} in {result['episodes']} episodes"
            + ("" if success is None else f", success {success:.0f} %")
            + (", the best so far" if better else "")
        )
        return whole and wanted is not None and (success or 0.0) >= wanted

    def _wall_s(self) -> float:
        return self._wall_before_s + time.perf_counter() - self._started

    def _save_when_due(self) -> None:
        if time.perf_counter() - self._saved >= self._period_s:
            self._save()

    def _save(self) -> None:
        self._checkpoints.save(
            {
                "wall_s": self._wall_s(),
                "target": self._target,
                "evaluated": self._evaluated,
                "ended_by": self._ended_by,
            }
        )
        self._saved = time.perf_counter()


def _between_rollouts(call: Callable[[], None]) -> Any:
    from stable_baselines3.common.callbacks import BaseCallback

    class BetweenRollouts(BaseCallback):
        def _on_rollout_start(self) -> None:
            call()

        def _on_step(self) -> bool:
            return True

    return BetweenRollouts()


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
    more = {"trained_by": "drs train", "seed": config.seed, "steps": int(model.num_timesteps)}
    return replace(agent, source={**source, **more, "settings": config.record()})
