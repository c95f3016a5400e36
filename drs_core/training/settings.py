"""The numbers that `--set` may give an algorithm: some are used hours after Stable-Baselines3 has taken them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drs_core.errors import UsageError, shown

_WHOLE = {
    "batch_size": (1, 10**7),
    "buffer_size": (1, 10**9),
    "gradient_steps": (-1, 10**6),
    "learning_starts": (0, 10**9),
    "n_epochs": (1, 10**6),
    "n_steps": (1, 10**7),
    "policy_delay": (1, 10**6),
    "target_update_interval": (1, 10**9),
    "top_quantiles_to_drop_per_net": (0, 10**4),
    "train_freq": (1, 10**9),
}
_REAL = {"gae_lambda": (0, 1), "gamma": (0, 1), "learning_rate": (0, 10), "max_grad_norm": (0, 1e9), "tau": (0, 1)}
RANGES = _WHOLE | _REAL


def check_settings(settings: Mapping[str, Any]) -> None:
    """Raise UsageError with the name, value and range of a number that is not allowed; others are the algorithm's."""
    for name in settings.keys() & RANGES.keys():
        value, (least, most) = settings[name], RANGES[name]
        if name == "train_freq" and isinstance(value, list):
            continue  # such as [1, "episode"]
        kind = int if name in _WHOLE else (int, float)
        if isinstance(value, bool) or not isinstance(value, kind) or not least <= value <= most:
            what = "whole numbers" if name in _WHOLE else "numbers"
            raise UsageError(f"The setting {name} is {shown(value)}; allowed are {what} from {least:g} to {most:g}.")
