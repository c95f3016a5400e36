"""Proof that whoever runs the episodes perturbs theta as whoever asks for them does."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from drs_core import __version__
from drs_core.policy import Float32
from drs_core.search import Perturbation

TEST = Perturbation(run_seed=0, update=0, direction=0, sign=1, sigma=0.025)
"""Drawn on both sides."""


def vector_digest(theta: Float32) -> str:
    """Hexadecimal sha256 of a parameter vector (d,), as little-endian float32."""
    return hashlib.sha256(np.ascontiguousarray(theta, dtype="<f4").tobytes()).hexdigest()


@dataclass(frozen=True)
class Proof:
    """What both sides have to find alike.

    Attributes:
        theta: its digest.
        candidate: the digest of what `TEST` makes of it.
        versions: of drs and numpy, for people.
    """

    theta: str
    candidate: str
    versions: str

    @classmethod
    def of(cls, theta: Float32) -> Proof:
        """What this process finds for theta (d,)."""
        versions = f"drs {__version__} with numpy {np.__version__}"
        return cls(vector_digest(theta), vector_digest(TEST.candidate(theta)), versions)

    def difference(self, here: Proof) -> str | None:
        """Why what is found `here` is not what whoever asks found; None where it is."""
        if here.theta != self.theta:
            return f"theta's digest is {here.theta[:16]}… there, not {self.theta[:16]}…: it changed on its way"
        if here.candidate != self.candidate:
            return f"{here.versions} there draws other perturbations than this run's {self.versions}"
        return None
