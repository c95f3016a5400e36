"""Which upstream versions fast stepping was proved against, and what happens with another one."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module, metadata
from typing import Any

from numpy.typing import NDArray

Stepper = Callable[[NDArray[Any]], tuple[Any, float, bool, bool, Mapping[str, Any]]]
"""What ``env.step`` is: action (n_actions,) -> observation, reward, terminated, truncated, info."""

PROVED = {"pybullet": "3.2.7", "pybullet-envs-gymnasium": "0.6.0", "panda-gym": "3.0.7"}
"""``tests/environments/test_fast.py`` holds the proof: whole episodes, side by side."""

_UPSTREAM = {"locomotion": "pybullet-envs-gymnasium", "panda": "panda-gym"}


def stepper(family: str, env: Any) -> Stepper | None:
    """The fast step of a bare upstream environment; None where plain stepping has to do.

    Args:
        family: of the catalogue's entry.
        env: unwrapped, made ready for exact repetition.
    """
    if family not in _UPSTREAM or not _is_proved(_UPSTREAM[family]):
        return None
    step: Stepper = import_module(f"drs_core.environments.fast.{family}").stepper(env)
    return step


@cache
def _is_proved(package: str) -> bool:
    """Whether `package` and PyBullet have the proved versions; says so, once a process, if not."""
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
