"""What the methods of search have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drs_core.policy import Float32
from drs_core.search import episode_seed

Float64 = NDArray[np.float64]
Candidates = Iterable[tuple[Float32, int]]
"""Parameters (d,) and the seed of the episode that values them."""
Value = Callable[[Candidates], Float64]
"""Objectives of candidates, one after the other."""


class Method(Protocol):
    """A search. It has no randomness but its seed, so the objectives that it was told bring it back."""

    @property
    def theta(self) -> Float32:
        """What it would deliver now, (d,)."""
        ...

    def update(self, value: Value) -> None:
        """One update; every candidate that it values is counted as a rollout."""
        ...


def pair_seeds(run_seed: int, update: int, rollouts: int) -> Iterator[int]:
    """Episode seeds of an update's candidates: two neighbours have the same, whatever the method."""
    return (episode_seed(run_seed, update, index // 2) for index in range(rollouts))
