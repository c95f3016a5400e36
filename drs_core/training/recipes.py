"""Settings that a baseline is trained with unless told otherwise; numbers after the rl-zoo's."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from drs_core.errors import UsageError
from drs_core.importing.layers import ALGORITHMS


@dataclass(frozen=True)
class Recipe:
    """How one algorithm is trained on one family of environments.

    Attributes:
        steps: environment steps, at most.
        hidden: units of the hidden layers.
        normalise: observations go through VecNormalize.
        time_feature: the remaining time is observed.
        hindsight: HER, for environments with goals.
        settings: keyword arguments of the algorithm.
    """

    steps: int = 300_000
    hidden: tuple[int, ...] = (256, 256)
    normalise: bool = True
    time_feature: bool = False
    hindsight: bool = False
    settings: dict[str, Any] = field(default_factory=dict)


_REPLAY: dict[str, Any] = {"learning_starts": 1000, "buffer_size": 300_000}
_SETTINGS: dict[str, dict[str, Any]] = {
    "a2c": {},
    "ppo": {},
    "ddpg": _REPLAY,
    "td3": _REPLAY,
    "sac": _REPLAY,
    "tqc": _REPLAY,
}
_PANDA_SETTINGS = {"gamma": 0.95, "learning_rate": 1e-3, "batch_size": 256}


def recipe(algorithm: str, environment_id: str) -> Recipe:
    """The recipe of an algorithm for an environment.

    Raises:
        UsageError: the algorithm is unknown.
    """
    if algorithm not in ALGORITHMS:
        raise UsageError(f"There is no algorithm {algorithm!r}; choose one of {', '.join(ALGORITHMS)}.")
    settings = dict(_SETTINGS[algorithm])
    off_policy = "buffer_size" in settings
    if environment_id.startswith("Panda"):
        reach = "Reach" in environment_id
        return Recipe(
            steps=20_000 if reach else 1_000_000,
            hidden=(64, 64) if reach else (256, 256),
            time_feature=True,
            hindsight=off_policy,
            settings=settings | (_PANDA_SETTINGS if off_policy else {}),
        )
    return Recipe(time_feature="BulletEnv" in environment_id, settings=settings)
