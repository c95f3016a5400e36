"""What the policy sees: an observation with its time feature, frozen normalisation, as one vector."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Observation = NDArray[np.floating] | Mapping[str, NDArray[np.floating]]

MAIN = "observation"
"""Key of the part that takes the time feature and that the mesh dimension looks at."""


@dataclass(frozen=True)
class Part:
    """One part of the observation: a whole Box, or one key of a Dict.

    Attributes:
        key: key in a dict observation; ``observation`` too where the observation is a plain Box.
        size: number of features, the time feature included.
        mean: (size,) float64 or None where this part is not normalised.
        variance: (size,) float64 or None, like mean.
    """

    key: str
    size: int
    mean: Float64 | None = None
    variance: Float64 | None = None

    def __post_init__(self) -> None:
        """Raise UsageError where sizes, ranges or finiteness are wrong."""
        if not 1 <= self.size <= 65536:
            raise UsageError(f"Part {self.key!r} has {self.size} features; allowed are 1..65536.")
        if (self.mean is None) != (self.variance is None):
            raise UsageError(f"Part {self.key!r} has only one of mean and variance.")
        for name, values in (("mean", self.mean), ("variance", self.variance)):
            if values is None:
                continue
            if values.shape != (self.size,):
                raise UsageError(
                    f"The normaliser's {name} of {self.key!r} has shape {values.shape}, the part {self.size} features."
                )
            if not np.isfinite(values).all():
                raise UsageError(f"The normaliser's {name} of {self.key!r} is not finite.")
        if self.variance is not None and (self.variance < 0.0).any():
            raise UsageError(f"The normaliser's variance of {self.key!r} is negative.")


@dataclass(frozen=True)
class Pipeline:
    """How an observation becomes the policy's input.

    Parts are concatenated in this order, each normalised as
    clip((x - mean) / sqrt(variance + epsilon), -clip, clip), as Stable-Baselines3's VecNormalize.

    Attributes:
        parts: in key order.
        is_dict: whether the environment gives a dict.
        time_limit_steps: T of the time feature 1 - t/T, or None without one.
        clip: bound of a normalised feature.
        epsilon: added to the variance.
    """

    parts: tuple[Part, ...]
    is_dict: bool = False
    time_limit_steps: int | None = None
    clip: float = 10.0
    epsilon: float = 1e-8

    def __post_init__(self) -> None:
        """Raise UsageError where a value is not allowed."""
        keys = [part.key for part in self.parts]
        if not keys or len(set(keys)) != len(keys):
            raise UsageError(f"Observation parts {keys} must be one or more, each once.")
        if (not self.is_dict or self.time_limit_steps is not None) and MAIN not in keys:
            raise UsageError(f"Observation parts {keys} lack the part {MAIN!r}.")
        if self.time_limit_steps is not None and not 1 <= self.time_limit_steps <= 10**9:
            raise UsageError(f"Time limit {self.time_limit_steps} is not allowed: 1..1e9 steps.")
        if not 0.0 < self.clip < float("inf") or not 0.0 <= self.epsilon < float("inf"):
            raise UsageError(f"Normaliser clip {self.clip} or epsilon {self.epsilon} is out of range (finite, > 0).")
        if any(part.variance is not None and (part.variance + self.epsilon <= 0.0).any() for part in self.parts):
            raise UsageError("The normaliser has a variance of 0 and an epsilon of 0: it would divide by 0.")

    @property
    def size(self) -> int:
        """n_features, the length of the policy's input."""
        return sum(part.size for part in self.parts)

    @property
    def normalised(self) -> bool:
        """Whether any part is normalised by statistics of its training."""
        return any(part.mean is not None for part in self.parts)

    @property
    def main(self) -> slice:
        """Where the part ``observation`` lies in the policy's input; everything without such a part."""
        start = 0
        for part in self.parts:
            if part.key == MAIN:
                return slice(start, start + part.size)
            start += part.size
        return slice(0, start)


class Assembler:
    """Applies a Pipeline, in preallocated buffers.

    Nothing of the normalisation can be folded into the policy's first layer without other bits:
    its result is clipped, and rounded to float32.
    """

    def __init__(self, pipeline: Pipeline) -> None:
        """Fold the parts' statistics into one mean, scale and clip (n_features,) float64 each."""
        self._raw = np.zeros(pipeline.size)
        self._mean, self._scale = np.zeros(pipeline.size), np.ones(pipeline.size)
        self._clip = np.full(pipeline.size, np.inf)
        self._slots: list[tuple[str, NDArray[np.float64]]] = []
        self._time_limit, self._time_index = pipeline.time_limit_steps, 0
        start = 0
        for part in pipeline.parts:
            stop = start + part.size
            if part.mean is not None and part.variance is not None:
                self._mean[start:stop] = part.mean
                self._scale[start:stop] = np.sqrt(part.variance + pipeline.epsilon)
                self._clip[start:stop] = pipeline.clip
            timed = pipeline.time_limit_steps is not None and part.key == MAIN
            if timed:
                self._time_index = stop - 1
            self._slots.append((part.key, self._raw[start : stop - 1 if timed else stop]))
            start = stop
        self._normalised = bool(np.isfinite(self._clip).any())
        self._low, self._scaled = -self._clip, np.empty(pipeline.size)
        self._rounded = array("f", (0.0,))

    def features(self, observation: Observation, step: int, out: Float32 | None = None) -> Float32:
        """Observation after `step` steps -> policy input (n_features,) float32, in `out` or a new array.

        Raises:
            ValueError: a part has another number of features than the pipeline says.
        """
        # the first question is the quick one
        if isinstance(observation, np.ndarray) or not isinstance(observation, Mapping):
            for _, slot in self._slots:
                slot[:] = observation
        else:
            for key, slot in self._slots:
                slot[:] = observation[key]
        x, rounded = self._raw, self._rounded
        if self._time_limit is not None:
            # rounded to float32 as in the wrapper that the agent was trained with
            rounded[0] = 1.0 - step / self._time_limit
            x[self._time_index] = rounded[0]
        if self._normalised:
            x = np.subtract(x, self._mean, self._scaled)
            x /= self._scale
            # a third of the time of clip, and the same bits: no bound is 0
            np.maximum(x, self._low, out=x)
            np.minimum(x, self._clip, out=x)
        if out is None:
            return x.astype(np.float32)
        out[...] = x
        return out
