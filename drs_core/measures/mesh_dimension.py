"""Mesh dimension of a trajectory, as in the paper's section on mesh dimensions.

Source of the exact procedure: the authors' program, whose values the tests hold. Counting boxes of
side d gives N(d); the dimension is how fast log N falls as log d grows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_RATIO = 1.2
_SMALLEST = 1e-9


def box_count(trajectory: NDArray[np.floating], d: float) -> int:
    """How many boxes of side d the trajectory (steps, features) visits."""
    boxes = np.round(trajectory * (1.0 / d))
    boxes += 0.0  # -0.0 and 0.0 are one box
    rows = boxes.view(np.dtype((np.void, boxes.dtype.itemsize * boxes.shape[1])))
    return len(set(rows.ravel().tolist()))


def mesh_dimension(trajectory: NDArray[np.floating]) -> tuple[float, float]:
    """Lower and upper bound of the mesh dimension of a trajectory (steps, features).

    Computed in the trajectory's own precision. Both are NaN where no line can be drawn: fewer than
    three box sizes between one box for all and one for every step.

    Raises:
        ValueError: the trajectory is not two-dimensional or not finite.
    """
    if trajectory.ndim != 2 or not np.isfinite(trajectory).all():
        raise ValueError(f"A trajectory is a finite array (steps, features), not of shape {trajectory.shape}.")
    x = np.ascontiguousarray(trajectory)
    steps = len(x)
    if steps == 0 or x.shape[1] == 0:
        return math.nan, math.nan
    sizes, counts = [1.0], [box_count(x, 1.0)]
    while counts[-1] < steps and sizes[-1] >= _SMALLEST:
        sizes.append(sizes[-1] / _RATIO)
        counts.append(box_count(x, sizes[-1]))
    sizes.reverse()
    counts.reverse()
    while counts[-1] > 1:
        sizes.append(sizes[-1] * _RATIO)
        counts.append(box_count(x, sizes[-1]))
    log_d, log_count = np.log2(sizes[:-1]), np.log2(counts[:-1])
    if len(log_d) < 2:
        return math.nan, math.nan
    centred = log_d - log_d.mean()
    lower = -float(centred @ log_count / (centred @ centred))
    slopes = -np.diff(log_count) / np.diff(log_d)
    upper = max(0.0, *slopes[:-1]) if len(slopes) > 1 else math.nan
    return lower, float(upper)


@dataclass(frozen=True)
class MeshDimension:
    """Mesh dimension of one trajectory.

    Attributes:
        lower, upper: bounds as `mesh_dimension` gives them, NaN where not computable.
        limit: half the number of features, the greatest that the search believes.
    """

    lower: float
    upper: float
    limit: float

    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound, the limit where not computable."""
        return self._or_limit(self.lower), self._or_limit(self.upper)

    def mean(self) -> float:
        """Mean of both bounds: what tables print."""
        return sum(self.bounds()) / 2.0

    def clipped_mean(self) -> float:
        """Mean of both bounds, each clipped to [0, limit]: D of the search's objective."""
        return sum(min(max(bound, 0.0), self.limit) for bound in self.bounds()) / 2.0

    def _or_limit(self, value: float) -> float:
        return self.limit if math.isnan(value) else value


def measure_dimension(trajectory: NDArray[np.floating]) -> MeshDimension:
    """Mesh dimension of a trajectory (steps, features) with the limit that belongs to it."""
    return MeshDimension(*mesh_dimension(trajectory), limit=trajectory.shape[1] / 2.0)
