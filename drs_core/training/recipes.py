"""Settings that a baseline is trained with unless told otherwise; numbers after the rl-zoo's."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from drs_core.errors import UsageError
from drs_core.importing.layers import ALGORITHMS
from drs_core.training.teachers import TEACHERS


@dataclass(frozen=True)
class Recipe:
    """How one algorithm is trained on one family of environments.

    Attributes:
        steps: environment steps, at most.
        hidden: units of the hidden layers.
        normalise: observations go through VecNormalize.
        time_feature: the remaining time is observed.
        hindsight: HER, for environments with goals.
        teacher: a scripted controller acts while the training warms up, for its first `learning_starts` steps.
        teach_every: later the teacher acts in every n-th episode; 0 for none.
        imitate: the actor imitates the teacher until so many steps were taken.
        noise: standard deviation of normal noise on the actions, scaled to [-1, 1]; 0 for none.
        decay: the learning rate falls linearly to 0 at the last step.
        evaluate_every: steps between evaluations.
        episodes: episodes of an evaluation that may make an agent the best.
        settings: keyword arguments of the algorithm.
        policy: keyword arguments of its policy.
    """

    steps: int = 300_000
    hidden: tuple[int, ...] = (256, 256)
    normalise: bool = True
    time_feature: bool = False
    hindsight: bool = False
    teacher: bool = False
    teach_every: int = 0
    imitate: int = 0
    noise: float = 0.0
    decay: bool = False
    evaluate_every: int = 2000
    episodes: int = 20
    settings: dict[str, Any] = field(default_factory=dict)
    policy: dict[str, Any] = field(default_factory=dict)


_REPLAY: dict[str, Any] = {"learning_starts": 1000, "buffer_size": 300_000}
# 400 episodes of Panda
_TAUGHT_STEPS = 20_000
# one exact action decides an episode, and what the algorithm alone makes of it is worse
_TAUGHT_LONGER: dict[str, dict[str, Any]] = {"PandaSlide-v3": {"steps": 200_000, "teach_every": 2, "imitate": 200_000}}
_SETTINGS: dict[str, dict[str, Any]] = {
    "a2c": {},
    "ppo": {},
    "ddpg": _REPLAY,
    "td3": _REPLAY,
    "sac": _REPLAY,
    "tqc": _REPLAY,
}
_PANDA_SETTINGS = {"gamma": 0.95, "learning_rate": 1e-3, "batch_size": 256}
# the zoo takes a gradient step of 2048 transitions every step, on 3 x 512 units; on one core gradient
# steps are nine tenths of the time then, and HER learns from few of them, so that most steps go without
_PANDA_OBJECT = {"buffer_size": 1_000_000, "tau": 0.05, "train_freq": 4, "gradient_steps": 1}
# the puck slides for up to 40 steps after the strike that decides all, and a strike bears little noise
_PANDA_SLIDE: dict[str, Any] = {"gamma": 0.98}
_PANDA_SLIDE_ENTROPY: dict[str, Any] = {"target_entropy": -6.0}
# one call for all of Adam's tensors, and a critic that is compared in 10 x 18 instead of 25 x 46 pairs:
# a third of a gradient step's time
_FUSED: dict[str, Any] = {"optimizer_kwargs": {"fused": True}}
_FEW_QUANTILES: dict[str, Any] = {"n_quantiles": 10}

_HOPPER_COMMON: dict[str, Any] = {
    "gamma": 0.98,
    "learning_starts": 10_000,
    "train_freq": 64,
    "gradient_steps": 64,
    "batch_size": 256,
}
_HOPPER_NOISY = _HOPPER_COMMON | {"learning_rate": 7e-4, "buffer_size": 200_000}
_HOPPER_ENTROPY = _HOPPER_COMMON | {"learning_rate": 7.3e-4, "buffer_size": 300_000, "tau": 0.02, "use_sde": True}
_HOPPER = Recipe(steps=500_000, normalise=False, time_feature=True, evaluate_every=10_000, policy=_FUSED)
_HOPPER_SDE = replace(_HOPPER, decay=True, policy=_FUSED | {"log_std_init": -3.0})
_HOPPER_RECIPES: dict[str, Recipe] = {
    "ddpg": replace(_HOPPER, noise=0.1, settings=_HOPPER_NOISY),
    "td3": replace(_HOPPER, noise=0.1, settings=_HOPPER_NOISY),
    "sac": replace(_HOPPER_SDE, settings=_HOPPER_ENTROPY),
    # the zoo drops 5 of 25
    "tqc": replace(
        _HOPPER_SDE,
        settings=_HOPPER_ENTROPY | {"top_quantiles_to_drop_per_net": 2},
        policy=_HOPPER_SDE.policy | _FEW_QUANTILES,
    ),
}


def recipe(algorithm: str, environment_id: str, teacher: bool | None = None) -> Recipe:
    """The recipe of an algorithm for an environment; with a teacher where there is one, unless told otherwise.

    Raises:
        UsageError: the algorithm is unknown.
    """
    if algorithm not in ALGORITHMS:
        raise UsageError(f"There is no algorithm {algorithm!r}; choose one of {', '.join(ALGORITHMS)}.")
    untaught = _untaught(algorithm, environment_id)
    if teacher is None:
        teacher = "learning_starts" in untaught.settings and environment_id in TEACHERS
    if not teacher:
        return untaught
    longer = _TAUGHT_LONGER.get(environment_id, {})
    return replace(untaught, teacher=True, settings=untaught.settings | {"learning_starts": _TAUGHT_STEPS}, **longer)


def _untaught(algorithm: str, environment_id: str) -> Recipe:
    if environment_id == "HopperBulletEnv-v0" and algorithm in _HOPPER_RECIPES:
        return _HOPPER_RECIPES[algorithm]
    settings = dict(_SETTINGS[algorithm])
    if environment_id.startswith("Panda"):
        return _panda(algorithm, settings, "Reach" in environment_id, "Slide" in environment_id)
    return Recipe(time_feature="BulletEnv" in environment_id, settings=settings)


def _panda(algorithm: str, settings: dict[str, Any], reach: bool, slide: bool) -> Recipe:
    off_policy, policy = "buffer_size" in settings, {}
    if off_policy:
        settings = settings | _PANDA_SETTINGS
    if off_policy and not reach:
        settings, policy = settings | _PANDA_OBJECT, dict(_FUSED)
        if algorithm == "tqc":
            settings, policy = settings | {"top_quantiles_to_drop_per_net": 1}, policy | _FEW_QUANTILES
    if off_policy and slide:
        settings |= _PANDA_SLIDE | (_PANDA_SLIDE_ENTROPY if algorithm in ("sac", "tqc") else {})
    return Recipe(
        steps=20_000 if reach else 1_000_000,
        hidden=(64, 64) if reach else (256, 256),
        time_feature=True,
        hindsight=off_policy,
        evaluate_every=2000 if reach else 20_000,
        episodes=100,
        settings=settings,
        policy=policy,
    )
