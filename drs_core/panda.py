"""Conventions of panda-gym's Panda: names, frames, and what an action means."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

ARM_JOINTS = tuple(f"panda_joint{number}" for number in range(1, 8))
FINGER_JOINTS = ("panda_finger_joint1", "panda_finger_joint2")
BASE_FROM_WORLD_M = np.array([0.6, 0.0, 0.0])
"""p_link0 = p_world + this: panda-gym's robot stands at x = -0.6 m."""
TIP_ORIENTATION = (1.0, 0.0, 0.0, 0.0)
"""(x, y, z, w) that panda-gym keeps the hand at."""
TIP_STEP_M = 0.05
"""Displacement of the tip for an action of 1."""
FINGER_STEP_M = 0.2
"""Change of the fingers' width for an action of 1."""


def tip_target(action: NDArray[np.float32], tip_position: Float64) -> Float64:
    """Where a panda-gym action sends the tip, (3,) [m] in the frame of the base.

    Args:
        action: (n_actions,) float32, the first three are the displacement in units of 0.05 m.
        tip_position: (3,) measured [m], in the frame of the base.
    """
    target: Float64 = tip_position + np.maximum(np.minimum(action[:3], 1.0), -1.0) * TIP_STEP_M
    target[2] = max(0.0, target[2])
    return target
