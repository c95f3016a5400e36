"""The policy: a multi-layer perceptron as one flat vector theta, and its maximum likelihood action.

The forward pass runs in float64 through ``numpy.einsum``, whose inner loops do not depend on the
BLAS kernel or the number of threads, and the action is rounded to float32. In a chaotic system a
difference of 1e-7 in one action is another episode, so this is what makes an episode the same on
every worker.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.scope import Scope

try:
    # what np.einsum and np.clip call after a microsecond of Python
    from numpy._core.multiarray import c_einsum as _einsum
    from numpy._core.umath import clip as _clip  # type: ignore[attr-defined]
except ImportError:
    from numpy import clip as _clip
    from numpy import einsum as _einsum

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

MAX_PARAMETERS = 16_000_000
OUTPUTS = ("clip", "tanh")

# arrays: a Python number is made into one at every use
_ZERO, _ONE = np.zeros(()), np.ones(())


def _relu(x: Float64) -> None:
    np.maximum(x, _ZERO, out=x)


def _tanh(x: Float64) -> None:
    np.tanh(x, out=x)


def _elu(x: Float64) -> None:
    np.copyto(x, np.expm1(np.minimum(x, 0.0)), where=x < 0.0)


def _leaky_relu(x: Float64) -> None:
    np.maximum(x, 0.01 * x, out=x)


def _silu(x: Float64) -> None:
    x /= 1.0 + np.exp(-np.maximum(x, -700.0))


ACTIVATIONS: dict[str, Callable[[Float64], None]] = {
    "elu": _elu,
    "leaky_relu": _leaky_relu,
    "relu": _relu,
    "silu": _silu,
    "tanh": _tanh,
}


@dataclass(frozen=True)
class Network:
    """Architecture of a policy.

    Attributes:
        sizes: number of features, units of each hidden layer, number of actions.
        activation: a key of ``ACTIVATIONS``, used after every hidden layer.
        output: ``clip`` (A2C, PPO: the mean is an action) or ``tanh`` (the others: squashed to
            [-1, 1], then scaled to the action bounds).
        mean_clip: with gSDE, SAC and TQC clip the mean to +-mean_clip before the tanh.
    """

    sizes: tuple[int, ...]
    activation: str
    output: str
    mean_clip: float | None = None

    def __post_init__(self) -> None:
        """Raise UsageError where a value is not allowed."""
        if len(self.sizes) < 2 or any(not 1 <= size <= 65536 for size in self.sizes):
            raise UsageError(f"Layer sizes {self.sizes} are not allowed: two or more, each 1..65536.")
        if self.activation not in ACTIVATIONS:
            raise UsageError(f"Activation {self.activation!r} is unknown; known: {', '.join(ACTIVATIONS)}.")
        if self.output not in OUTPUTS:
            raise UsageError(f"Output {self.output!r} is unknown; known: {', '.join(OUTPUTS)}.")
        if self.mean_clip is not None and not 0.0 < self.mean_clip < float("inf"):
            raise UsageError(f"mean_clip {self.mean_clip} is not allowed: a finite number above 0.")
        if self.parameters > MAX_PARAMETERS:
            raise UsageError(f"A network of {self.parameters} parameters is above the limit of {MAX_PARAMETERS}.")

    @property
    def shapes(self) -> list[tuple[int, int]]:
        """(outputs, inputs) of every layer."""
        return list(zip(self.sizes[1:], self.sizes[:-1], strict=True))

    @property
    def parameters(self) -> int:
        """d, the length of theta: every weight and bias."""
        return sum(rows * columns + rows for rows, columns in self.shapes)

    @property
    def last_layer_start(self) -> int:
        """Where the last layer begins in theta."""
        rows, columns = self.shapes[-1]
        return self.parameters - rows * columns - rows

    def scope(self, last_layer: bool = False, action_gains: bool = False) -> Scope:
        """What of theta a search has: the last layer, the gains of the actions, or all."""
        start = self.last_layer_start if last_layer or action_gains else 0
        return Scope(start, self.sizes[-1] if action_gains else 0)

    def layers(self, theta: NDArray[np.floating]) -> list[tuple[NDArray[np.floating], NDArray[np.floating]]]:
        """Views (weight (outputs, inputs), bias (outputs,)) of theta (d,), layer by layer."""
        views, start = [], 0
        for rows, columns in self.shapes:
            split = start + rows * columns
            views.append((theta[start:split].reshape(rows, columns), theta[split : split + rows]))
            start = split + rows
        return views


class Policy:
    """Maximum likelihood actions of one parameter vector at a time, in preallocated buffers."""

    def __init__(self, network: Network, low: Float32, high: Float32) -> None:
        """Prepare buffers; low and high (n_actions,) float32 are the action bounds."""
        self.network = network
        self._theta = np.zeros(network.parameters)
        buffers = [np.empty(size) for size in network.sizes]
        self._features, self._mean = buffers[0], buffers[-1]
        layers = network.layers(self._theta)
        self._layers = [(*layer, x, out) for layer, x, out in zip(layers, buffers[:-1], buffers[1:], strict=True)]
        self._activate = ACTIVATIONS[network.activation]
        self._low, self._high = low.astype(np.float64), high.astype(np.float64)
        self._half_range = 0.5 * (self._high - self._low)

    def load(self, theta: Float32) -> None:
        """Use theta (d,) float32 from now on."""
        self._theta[:] = theta

    def act(self, features: Float32, out: Float32 | None = None) -> Float32:
        """Features (n_features,) float32 -> action (n_actions,) float32 within the bounds, in `out` or a new array."""
        mean, activate = self._mean, self._activate
        self._features[...] = features
        for weight, bias, x, y in self._layers:
            _einsum("ij,j->i", weight, x, out=y)
            y += bias
            if y is not mean:
                activate(y)
        if self.network.output == "tanh":
            if self.network.mean_clip is not None:
                _clip(mean, -self.network.mean_clip, self.network.mean_clip, mean)
            np.tanh(mean, out=mean)
            mean += _ONE
            mean *= self._half_range
            mean += self._low
        else:
            _clip(mean, self._low, self._high, mean)
        if out is None:
            return mean.astype(np.float32)
        out[...] = mean
        return out
