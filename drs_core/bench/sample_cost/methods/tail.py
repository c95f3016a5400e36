"""A search of the last layer only: whatever the method, it sees no other parameters."""

from __future__ import annotations

import numpy as np

from drs_core.bench.sample_cost.methods.method import Method, Value
from drs_core.policy import Float32


class Tail:
    """A method over the end of theta; what stands before it stays."""

    def __init__(self, method: Method, head: Float32) -> None:
        """`method` begins at the tail (d - start,), `head` is what stands before it (start,)."""
        self._method, self._head = method, head
        self.rollouts = method.rollouts

    @property
    def theta(self) -> Float32:
        """All of it, (d,)."""
        return np.concatenate((self._head, self._method.theta))

    def update(self, value: Value) -> None:
        """One update."""
        self._method.update(
            lambda candidates: value((np.concatenate((self._head, tail)), seed) for tail, seed in candidates)
        )
