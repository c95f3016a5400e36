"""EvoTorch's searches from the same start: PGPE and SNES."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import torch
from evotorch import Problem
from evotorch.algorithms import PGPE, SNES

from drs_core.bench.sample_cost.methods.method import Value, pair_seeds
from drs_core.policy import Float32

logging.getLogger("evotorch").setLevel(logging.WARNING)


class EvoTorch:
    """One of its searches; delivers the centre of its distribution."""

    def __init__(self, name: str, seed: int, theta: Float32, rollouts: int, sigma: float, alpha: float) -> None:
        """Begin at theta (d,) with the standard deviation sigma; PGPE takes steps of a length of alpha sqrt(d)."""
        self.theta, self._seed, self._done = theta.copy(), seed, 0
        self._value: Value | None = None
        problem = Problem("max", solution_length=len(theta), initial_bounds=(-1, 1), seed=seed + 1)
        problem._evaluate_batch = self._evaluate
        start: dict[str, Any] = {"center_init": torch.tensor(theta), "stdev_init": sigma, "popsize": rollouts}
        if name == "pgpe":
            # its own Adam and ranks, as its examples use them
            rates = {"center_learning_rate": alpha, "stdev_learning_rate": 0.1, "optimizer": "adam"}
            self._search: Any = PGPE(problem, ranking_method="centered", **rates, **start)
        else:
            self._search = SNES(problem, **start)

    def update(self, value: Value) -> None:
        """One generation."""
        self._value = value
        self._search.step()
        self.theta = self._search.status["center"].numpy().astype(np.float32)
        self._done += 1

    def _evaluate(self, batch: Any) -> None:
        candidates = batch.values.numpy().astype(np.float32)
        seeds = pair_seeds(self._seed, self._done, len(candidates))
        assert self._value is not None
        objectives = self._value(zip(candidates, seeds, strict=True))
        batch.set_evals(torch.tensor(objectives, dtype=torch.float32))
