"""The twelve environments of the paper: names, the package that registers each, its clock, when it succeeded."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

Success = Callable[[bool, float, Mapping[str, Any]], bool | None]


def _undefined(terminated: bool, reward: float, info: Mapping[str, Any]) -> bool | None:
    success = info.get("is_success")
    return None if success is None else bool(success)


def _by_ending(terminated: bool, reward: float, info: Mapping[str, Any]) -> bool | None:
    return terminated


def _without_crash(terminated: bool, reward: float, info: Mapping[str, Any]) -> bool | None:
    # Box2D environments give exactly -100 for a crash, whatever else the step earned
    return terminated and reward != -100


@dataclass(frozen=True)
class Entry:
    """How to make one environment.

    Attributes:
        package: module whose import registers the id, if any.
        family: decides what makes its episodes exactly repeatable.
        success: whether the episode has succeeded, from the last step; None where undefined.
        period_s: time between two actions [s]; None where only the environment itself may say.
        limit_steps: an episode's greatest length; None likewise.
    """

    package: str | None = None
    family: str = "plain"
    success: Success = _undefined
    period_s: float | None = None
    limit_steps: int | None = None


_LOCOMOTION = Entry("pybullet_envs_gymnasium", "locomotion", period_s=0.0165, limit_steps=1000)
_PANDA = Entry("panda_gym.envs", "panda", period_s=0.04, limit_steps=50)
_LANDER = Entry(family="classic", success=_without_crash, period_s=0.02, limit_steps=1000)
_BIPEDAL = Entry(family="bipedal", success=_without_crash, period_s=0.02, limit_steps=1600)
# its equations know no seconds: the rate at which it is drawn
_MOUNTAIN_CAR = Entry(family="classic", success=_by_ending, period_s=1 / 30, limit_steps=999)

PAPER: dict[str, Entry] = {
    "MountainCarContinuous-v0": _MOUNTAIN_CAR,
    "LunarLanderContinuous-v3": _LANDER,
    "BipedalWalker-v3": _BIPEDAL,
    "BipedalWalkerHardcore-v3": replace(_BIPEDAL, limit_steps=2000),
    "HalfCheetahBulletEnv-v0": _LOCOMOTION,
    "HopperBulletEnv-v0": _LOCOMOTION,
    "Walker2DBulletEnv-v0": _LOCOMOTION,
    "AntBulletEnv-v0": _LOCOMOTION,
    "PandaReach-v3": _PANDA,
    "PandaPush-v3": _PANDA,
    "PandaSlide-v3": _PANDA,
    "PandaPickAndPlace-v3": _PANDA,
}

OLD_NAMES = {
    "LunarLanderContinuous-v2": "LunarLanderContinuous-v3",
    "Pendulum-v0": "Pendulum-v1",
}


def current_name(environment_id: str) -> str:
    """The id of today for an id of the past: ``PandaReach-v1`` -> ``PandaReach-v3``."""
    return OLD_NAMES.get(environment_id, re.sub(r"^(Panda\w+)-v[12]$", r"\1-v3", environment_id))


def entry(environment_id: str) -> Entry:
    """The catalogue's entry; other ids are made as gymnasium makes them, without the guarantee."""
    if environment_id in PAPER:
        return PAPER[environment_id]
    if environment_id.startswith("Panda"):
        return Entry("panda_gym.envs", "panda-other")
    if "BulletEnv" in environment_id:
        return Entry("pybullet_envs_gymnasium")
    return Entry()
