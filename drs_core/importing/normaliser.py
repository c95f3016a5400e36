"""The statistics of a saved VecNormalize, read as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.importing.arrays import array, number
from drs_core.importing.pickle_data import Call, Name, read_pickle

MAX_PICKLE_BYTES = 4 * 2**20
_LARGEST_CLIP = 1e30
_PACKAGES = ("numpy", "gym", "gymnasium", "stable_baselines3")
_BUILTINS = {
    "collections.OrderedDict",
    "collections.deque",
    "_codecs.encode",
    "builtins.set",
    "builtins.frozenset",
    "builtins.slice",
}

Moments = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class Normaliser:
    """Frozen observation statistics.

    Attributes:
        moments: (mean, variance) by observation key; the key is ``observation`` for a plain Box.
        clip: bound of a normalised feature.
        epsilon: added to the variance.
    """

    moments: dict[str, Moments]
    clip: float
    epsilon: float


def read_normaliser(content: bytes, name: str) -> Normaliser:
    """Read vecnormalize.pkl of any Stable-Baselines3 version.

    Raises:
        UsageError: it holds something else, or names code that a normaliser does not need.
    """
    record = read_pickle(content, name, _allowed)
    state = record.state if isinstance(record, Call) else None
    if not isinstance(record, Call) or not isinstance(state, dict) or not isinstance(record.function, Name):
        raise UsageError(f"{name} holds no VecNormalize; give the vecnormalize.pkl saved with the agent.")
    try:
        clip = min(number(state["clip_obs"], f"clip_obs in {name}"), _LARGEST_CLIP)
        epsilon = number(state["epsilon"], f"epsilon in {name}")
        if not state.get("norm_obs", True):
            return Normaliser({}, clip, epsilon)
        statistics = state["obs_rms"]
        named = statistics if isinstance(statistics, dict) else {"observation": statistics}
        keys = state.get("norm_obs_keys")
        chosen = keys if isinstance(statistics, dict) and isinstance(keys, list) else list(named)
        if not all(isinstance(key, str) for key in chosen):
            raise UsageError(f"{name} names a part of the observation by something else than text.")
        return Normaliser({key: _moments(named[key], name) for key in chosen}, clip, epsilon)
    except (KeyError, AttributeError, TypeError) as error:
        raise UsageError(f"{name} lacks a part of a VecNormalize ({str(error)[:80]}).") from error


def _is_vec_normalize(record: Call) -> bool:
    return isinstance(record.function, Name) and record.function.name == "VecNormalize"


def _moments(record: Any, name: str) -> Moments:
    state = record.state
    return array(state["mean"], f"a mean in {name}"), array(state["var"], f"a variance in {name}")


def _allowed(name: Name) -> bool:
    return name.module.split(".")[0] in _PACKAGES or str(name) in _BUILTINS
