"""What a teacher is, and the action that it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Teacher = Callable[[Mapping[str, NDArray[Any]]], NDArray[np.float64]]
"""From an observation to an action in [-1, 1]."""


def limited(*action: float) -> NDArray[np.float64]:
    """The action of these components, each brought to [-1, 1]."""
    return np.asarray(np.clip(action, -1.0, 1.0), np.float64)
