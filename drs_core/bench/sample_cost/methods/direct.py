"""Direct random search as the product does it, and what may be changed in it: a class a change."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import chain

import numpy as np

from drs_core.bench.sample_cost.methods.method import Candidates, Float64, Value
from drs_core.policy import Float32
from drs_core.search import SearchConfig, direction, episode_seed


class Direct:
    """The search of `drs_core.search`: both sides of n directions, a step along their weighted sum."""

    def __init__(self, config: SearchConfig, theta: Float32) -> None:
        """Begin at theta (d,)."""
        self.config, self.theta, self.done = config, theta.copy(), 0
        self.rollouts = 2 * config.directions

    def ask(self) -> Candidates:
        """Both sides of every direction, with the direction's episode seed."""
        sigma = self.config.sigma_at(self.done)
        for index, delta in enumerate(self.deltas()):
            seed = episode_seed(self.config.seed, self.done, index)
            for sign in (1, -1):
                yield self.theta + delta * np.float32(sign * sigma), seed

    def tell(self, objectives: Float64) -> None:
        """Take the step that the objectives (2n,) of `ask` call for."""
        weights = self.weights(objectives.reshape(-1, 2))
        gradient = np.zeros(len(self.theta))
        for weight, delta in zip(weights, self.deltas(), strict=True):
            if weight:
                gradient += delta * weight
        step = self.step(gradient)
        self.theta = (self.theta + step).astype(np.float32)
        self.done += 1

    def update(self, value: Value) -> None:
        """Ask, tell."""
        self.tell(value(self.ask()))

    def deltas(self) -> Iterator[Float32]:
        """Every direction delta_i, (d,)."""
        return (direction(self.config.seed, self.done, i, len(self.theta)) for i in range(self.config.directions))

    def weights(self, objectives: Float64) -> Float64:
        """Of each direction in the gradient, from objectives (n, 2): (R+ - R-) / (n s)."""
        spread = objectives.std()
        differences = objectives[:, 0] - objectives[:, 1]
        return differences / (len(objectives) * spread) if spread else np.zeros(len(objectives))

    def step(self, gradient: Float64) -> Float64:
        """The way from theta to the next."""
        return self.config.alpha_at(self.done) * gradient


class TopDirections(Direct):
    """Only the half of the directions counts that has the best side (ARS V1-t: Mania, Guy, Recht, 2018)."""

    def weights(self, objectives: Float64) -> Float64:
        """As there: s and n are those of the directions that count."""
        best = np.argsort(-objectives.max(axis=1), kind="stable")[: max(1, len(objectives) // 2)]
        weights = np.zeros(len(objectives))
        weights[best] = super().weights(objectives[best])
        return weights


class Ranks(Direct):
    """Centred ranks in place of objectives (Salimans et al., 2017); equal ones share their ranks."""

    def weights(self, objectives: Float64) -> Float64:
        """Of the ranks."""
        from scipy.stats import rankdata

        return super().weights(rankdata(objectives).reshape(objectives.shape))


class Orthogonal(Direct):
    """Directions that are orthogonal to each other, of the lengths that they had (Choromanski et al., 2018)."""

    def deltas(self) -> Iterator[Float32]:
        """Orthogonal, as many at a time as there are dimensions."""
        drawn = np.array(list(super().deltas()), dtype=np.float64)
        lengths = np.linalg.norm(drawn, axis=1, keepdims=True)
        blocks = (drawn[first : first + drawn.shape[1]] for first in range(0, len(drawn), drawn.shape[1]))
        rows = chain.from_iterable(np.linalg.qr(block.T)[0].T for block in blocks)
        return ((row * length).astype(np.float32) for row, length in zip(rows, lengths, strict=True))


class Momentum(Direct):
    """The heavy ball: steps remember the ones before."""

    beta = 0.8

    def __init__(self, config: SearchConfig, theta: Float32) -> None:
        """Begin at theta, at rest."""
        super().__init__(config, theta)
        self._mean = np.zeros(len(theta))

    def step(self, gradient: Float64) -> Float64:
        """Along the running mean, freed from its start at zero."""
        self._mean = self.beta * self._mean + (1 - self.beta) * gradient
        return super().step(self._mean / (1 - self.beta ** (self.done + 1)))


class Adam(Momentum):
    """Adam on the estimated gradient (Kingma and Ba, 2015), its step as long as that of the plain search at first."""

    beta, beta_square = 0.8, 0.99

    def __init__(self, config: SearchConfig, theta: Float32) -> None:
        """Begin at theta, at rest."""
        super().__init__(config, theta)
        self._square, self._scale = np.zeros(len(theta)), 0.0

    def step(self, gradient: Float64) -> Float64:
        """Each parameter's share divided by the size that its gradient has had."""
        self._square = self.beta_square * self._square + (1 - self.beta_square) * gradient**2
        size = np.sqrt(self._square / (1 - self.beta_square ** (self.done + 1)))
        self._scale = self._scale or float(np.sqrt(np.mean(gradient**2)))
        return super().step(gradient) / (size + 1e-8) * self._scale


class Guided(Direct):
    """A share of the directions' variance lies in the space of the last steps (Maheswaranathan et al., 2019)."""

    remembered, share = 10, 0.5

    def __init__(self, config: SearchConfig, theta: Float32) -> None:
        """Begin at theta, without steps to remember."""
        super().__init__(config, theta)
        self._steps: deque[Float64] = deque(maxlen=self.remembered)

    def deltas(self) -> Iterator[Float32]:
        """Of covariance (1 - share) I + share d / k U U^T, U the k steps' basis; as long as they were, on average."""
        drawn = super().deltas()
        if not self._steps:
            return drawn
        basis = np.linalg.qr(np.array(self._steps).T)[0].astype(np.float32)
        d, k = basis.shape
        outside = np.float32(np.sqrt(1 - self.share))
        more = np.float32(np.sqrt(1 - self.share + self.share * d / k)) - outside
        return (outside * delta + basis @ (more * (basis.T @ delta)) for delta in drawn)

    def step(self, gradient: Float64) -> Float64:
        """As ever, and remembered."""
        step = super().step(gradient)
        if step.any():
            self._steps.append(step)
        return step
