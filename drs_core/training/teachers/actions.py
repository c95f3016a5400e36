"""The action that a teacher gives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def limited(*action: float) -> NDArray[np.float64]:
    """The action of these components, each brought to [-1, 1]."""
    return np.asarray(np.clip(action, -1.0, 1.0), np.float64)
