"""Which upstream versions fast stepping was proved against, and what happens with another one."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module, metadata
from typing import Any

from numpy.typing import NDArray

from drs_core.environments.catalogue import entry

Stepper = Callable[[NDArray[Any]], tuple[Any, float, bool, bool, Mapping[str, Any]]]
"""What ``env.step`` is: action (n_actions,) -> observation, reward, terminated, truncated, info."""

PROVED = {"pybullet": "3.2.7", "pybullet-envs-gymnasium": "0.6.0", "panda-gym": "3.0.7"}
"""``tests/environments/test_fast.py`` holds the proof: whole episodes, side by side."""

_UPSTREAM = {"locomotion": "pybullet-envs-gymnasium", "panda": "panda-gym"}


def is_proved(environment_id: str) -> bool:
    """Whether there is a fast step, and the installed packages are those that it was proved against.

    Where they are others, it says so in one line of log, once a process.
    """
    family = entry(environment_id).family
    return family in _UPSTREAM and _is_proved(_UPSTREAM[family])


def stepper(environment_id: str, env: Any) -> Stepper | None:
    """The fast step of a bare upstream environment; None where plain stepping has to do.

    Args:
        environment_id: a current one.
        env: unwrapped, made ready for exact repetition.
    """
    if not is_proved(environment_id):
        return None
    step: Stepper = import_module(f"drs_core.environments.fast.{entry(environment_id).family}").stepper(env)
    return step


@cache
def _is_proved(package: str) -> bool:
    found = {name: _version(name) for name in ("pybullet", package)}
    others = {name: version for name, version in found.items() if version != PROVED[name]}
    if others:
        wrong = " and ".join(f"{name} {version} (proved: {PROVED[name]})" for name, version in others.items())
        logging.getLogger("drs").warning(
            "Fast stepping is off: it was not proved against %s. Episodes are upstream's either way, only slower.",
            wrong,
        )
    return not others


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"
