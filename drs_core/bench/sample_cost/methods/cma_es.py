"""Separable CMA-ES by the library cma."""

from __future__ import annotations

import cma
import numpy as np

from drs_core.bench.sample_cost.methods.method import Value, pair_seeds
from drs_core.policy import Float32


class SepCma:
    """A diagonal covariance from the start on (Ros and Hansen, 2008); delivers its mean."""

    def __init__(self, seed: int, theta: Float32, rollouts: int, sigma: float) -> None:
        """Begin at theta (d,) with the standard deviation sigma."""
        self.theta, self._seed, self._done = theta.copy(), seed, 0
        options = {
            "CMA_diagonal": True,
            "popsize": rollouts,
            "seed": seed + 1,
            "verbose": -9,
            "termination_callback": [],
        }
        self._search = cma.CMAEvolutionStrategy(theta.astype(np.float64), sigma, options)

    def update(self, value: Value) -> None:
        """One generation."""
        candidates = self._search.ask()
        asked = (np.asarray(candidate, dtype=np.float32) for candidate in candidates)
        objectives = value(zip(asked, pair_seeds(self._seed, self._done, len(candidates)), strict=True))
        self._search.tell(candidates, (-objectives).tolist())
        self.theta = np.asarray(self._search.result.xfavorite, dtype=np.float32)
        self._done += 1
