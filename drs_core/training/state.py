"""What a training is between two rollouts, as arrays and numbers: nothing in it needs unpickling."""

from __future__ import annotations

import io
import random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.training.model import Learner

Arrays = dict[str, NDArray[Any]]

_COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")


def numbers(learner: Learner) -> dict[str, Any]:
    """Counters and the small random generators, as JSON has them."""
    version, words, gauss = random.getstate()
    numpy_state = np.random.get_state(legacy=False)
    return {
        "counters": {name: int(getattr(learner.model, name)) for name in _COUNTERS},
        "episode_seeds": learner.episode_seeds.bit_generator.state,
        "random_actions": learner.model.action_space.np_random.bit_generator.state,
        "python": [version, list(words), gauss],
        "numpy": {**numpy_state, "state": {"pos": int(numpy_state["state"]["pos"])}},
    }


def arrays(learner: Learner) -> Arrays:
    """The normaliser and the large random states."""
    import torch

    found: Arrays = {
        "random.numpy": np.asarray(np.random.get_state(legacy=False)["state"]["key"]),
        "random.torch": torch.get_rng_state().numpy(),
    }
    for key, statistics in _statistics(learner.model).items():
        for name in ("mean", "var", "count"):
            found[f"normaliser.{key}.{name}"] = np.asarray(getattr(statistics, name), dtype=np.float64)
    return found


def tensors(learner: Learner) -> bytes:
    """Every network and optimiser, as ``torch.load(weights_only=True)`` reads them."""
    import torch

    model = learner.model
    content = {
        "parameters": model.get_parameters(),
        "variables": {name: getattr(model, name).detach() for name in model._get_torch_save_params()[1]},
    }
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


def restore(learner: Learner, numbers: dict[str, Any], arrays: Arrays, tensors: bytes) -> None:
    """Make an untrained learner what it was when these were taken; its environment begins a new episode.

    Raises:
        UsageError: they are not of such a model.
    """
    import torch

    model = learner.model
    try:
        content = torch.load(io.BytesIO(tensors), weights_only=True, map_location="cpu")
        model.set_parameters(content["parameters"], exact_match=True)
        for name in model._get_torch_save_params()[1]:
            getattr(model, name).data.copy_(content["variables"][name])
        for key, statistics in _statistics(model).items():
            statistics.mean = _like(arrays[f"normaliser.{key}.mean"], statistics.mean)
            statistics.var = _like(arrays[f"normaliser.{key}.var"], statistics.var)
            statistics.count = float(arrays[f"normaliser.{key}.count"])
        for name in _COUNTERS:
            setattr(model, name, int(numbers["counters"][name]))
        learner.tell_progress()
        _restore_generators(learner, numbers, arrays)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise UsageError(f"The state kept does not fit this model: {str(error)[:200]}.") from error


def _restore_generators(learner: Learner, numbers: dict[str, Any], arrays: Arrays) -> None:
    import torch

    learner.episode_seeds.bit_generator.state = numbers["episode_seeds"]
    learner.model.action_space.np_random.bit_generator.state = numbers["random_actions"]
    version, words, gauss = numbers["python"]
    random.setstate((version, tuple(words), gauss))
    state = dict(numbers["numpy"])
    np.random.set_state({**state, "state": {"key": arrays["random.numpy"], "pos": state["state"]["pos"]}})
    torch.set_rng_state(torch.from_numpy(arrays["random.torch"].copy()))


def _statistics(model: Any) -> dict[str, Any]:
    """Running mean and variance of every observation part; rewards are not normalised."""
    normaliser = model.get_vec_normalize_env()
    if normaliser is None:
        return {}
    found = normaliser.obs_rms
    return dict(found) if isinstance(found, dict) else {"observation": found}


def _like(value: NDArray[Any], before: NDArray[Any]) -> NDArray[Any]:
    if value.shape != before.shape:
        raise ValueError(f"statistics of shape {value.shape}, not {before.shape}")
    return value
