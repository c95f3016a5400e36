"""Direct random search: ask for perturbations, tell their objectives. Pure: no state but theta and k.

Source: Algorithm 1 of Gillen, Ozmen and Byl. As printed it steps downhill (its first n candidates
are theta - delta) and scales the step by sigma twice; the authors' program does what stands here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.scope import ALL, Scope

Float32 = NDArray[np.float32]

_DIRECTION, _EPISODE_SEED, _EVALUATION_SEED, _BASELINE_SEED = 1, 2, 3, 4
_SEEDS = 2**31
MAX_UPDATES = 1_000_000
MAX_DIRECTIONS = 65_536


@dataclass(frozen=True)
class SearchConfig:
    """Settings of a search; the defaults are the paper's.

    Attributes:
        updates: K.
        directions: n, each rolled out on both sides.
        alpha: step size, first and last update.
        sigma: standard deviation of the perturbation, first and last update.
        seed: of every random number of the search.
        last_layer: perturb and move only the last layer (the paper's subset ablation).
        action_gains: perturb and move only the gain of each action; alpha and sigma are relative then.
        top: b, only the b directions count whose better side is best (ARS V1-t: Mania, Guy and Recht, 2018);
            0 for all, as is n or more.
        paired_spread: s is the spread within pairs, so that steps keep their length however much episodes differ
            from seed to seed, and however little the two sides of a direction do.
    """

    updates: int = 200
    directions: int = 64
    alpha: tuple[float, float] = (0.02, 0.002)
    sigma: tuple[float, float] = (0.025, 0.0025)
    seed: int = 0
    last_layer: bool = False
    action_gains: bool = False
    top: int = 0
    paired_spread: bool = False

    def __post_init__(self) -> None:
        """Raise UsageError with the name, value and range of a setting that is not allowed."""
        for name, most in (("updates", MAX_UPDATES), ("directions", MAX_DIRECTIONS)):
            value = getattr(self, name)
            if not 1 <= value <= most:
                raise UsageError(f"{name} is {value}; allowed are 1 to {most}.")
        if not 0 <= self.top <= MAX_DIRECTIONS:
            raise UsageError(f"top is {self.top}; allowed are 0 (all directions count) to {MAX_DIRECTIONS}.")
        if self.last_layer and self.action_gains:
            raise UsageError("last_layer and action_gains are both set; set one: the gains are part of the last layer.")
        if not 0 <= self.seed < 2**63:
            raise UsageError(f"seed is {self.seed}; allowed are 0 to 2^63 - 1.")
        for name, least in (("alpha", 0.0), ("sigma", 1e-12)):
            values = getattr(self, name)
            if len(values) != 2 or not all(math.isfinite(value) and least <= value <= 1e3 for value in values):
                raise UsageError(f"{name} is {list(values)}; allowed are two finite numbers from {least:g} to 1000.")

    def alpha_at(self, update: int) -> float:
        """alpha_k."""
        return _linear(self.alpha, update, self.updates)

    def sigma_at(self, update: int) -> float:
        """sigma_k."""
        return _linear(self.sigma, update, self.updates)


def _linear(ends: tuple[float, float], update: int, updates: int) -> float:
    first, last = ends
    return first if updates == 1 else first + (last - first) * update / (updates - 1)


@dataclass(frozen=True)
class Perturbation:
    """One side of one direction; enough to make the candidate from theta on any machine.

    Attributes:
        run_seed: seed of the search.
        update: k.
        direction: i.
        sign: +1 or -1.
        sigma: sigma_k.
        scope: what of theta is perturbed.
    """

    run_seed: int
    update: int
    direction: int
    sign: int
    sigma: float
    scope: Scope = ALL

    def candidate(self, theta: Float32) -> Float32:
        """Theta + sign * sigma * delta_i, or with gains theta times 1 + sign * sigma * delta_i, (d,) float32."""
        start, candidate = self.scope.start, np.empty_like(theta)
        candidate[:start] = theta[:start]
        delta = _newest_direction(self.run_seed, self.update, self.direction, self.scope.size(len(theta)))
        scale = np.float32(self.sign * self.sigma)
        if self.scope.gains:
            candidate[start:] = self.scope.scaled(theta, np.float32(1.0) + scale * delta)
        else:
            moved = np.multiply(delta, scale, out=candidate[start:])
            moved += theta[start:]
        return candidate


def _keyed(run_seed: int, purpose: int, update: int, index: int) -> np.random.Generator:
    """A generator of its own for each purpose, update and index: counter-based, so in any order."""
    key = np.array([run_seed, purpose], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=np.array([0, 0, index, update], dtype=np.uint64)))


def direction(run_seed: int, update: int, index: int, d: int) -> Float32:
    """delta_i of update k: (d,) float32, standard normal."""
    return _keyed(run_seed, _DIRECTION, update, index).standard_normal(d, dtype=np.float32)


@lru_cache(maxsize=1)
def _newest_direction(run_seed: int, update: int, index: int, d: int) -> Float32:
    """The same, kept for the other side of the direction, which most often comes next."""
    delta = direction(run_seed, update, index, d)
    delta.flags.writeable = False
    return delta


def episode_seed(run_seed: int, update: int, index: int) -> int:
    """s_i of update k, the episode seed of both sides of direction i."""
    return int(_keyed(run_seed, _EPISODE_SEED, update, index).integers(_SEEDS))


def evaluation_seeds(run_seed: int, episodes: int) -> list[int]:
    """Episode seeds for evaluation during a run, apart from the search's, the same at every update."""
    return [int(_keyed(run_seed, _EVALUATION_SEED, 0, index).integers(_SEEDS)) for index in range(episodes)]


def baseline_seeds(run_seed: int, episodes: int) -> list[int]:
    """Episode seeds for figures of the agent that a run begins with, apart from all others."""
    return [int(_keyed(run_seed, _BASELINE_SEED, 0, index).integers(_SEEDS)) for index in range(episodes)]


def ask(
    config: SearchConfig, update: int, scope: Scope = ALL, sigma: float | None = None
) -> list[tuple[Perturbation, int]]:
    """Update k's 2n rollouts as (perturbation, episode seed): direction by direction, + before -.

    `sigma` takes the place of sigma_k, where something holds it below.
    """
    sigma = config.sigma_at(update) if sigma is None else sigma
    return [
        (Perturbation(config.seed, update, index, sign, sigma, scope), seed)
        for index in range(config.directions)
        for seed in [episode_seed(config.seed, update, index)]
        for sign in (1, -1)
    ]


def tell(
    config: SearchConfig, update: int, theta: Float32, objectives: NDArray[np.float64], scope: Scope = ALL
) -> Float32:
    """Update k: theta + alpha_k / (n s) * sum_i (R+_i - R-_i) delta_i, a new (d,) float32; gains are times 1 + that.

    Args:
        config: settings of the search.
        update: k.
        theta: (d,) float32 before the update.
        objectives: (n, 2) float64, R+_i and R-_i; a row of two NaN is a pair that was dropped.
        scope: what of theta moves.

    s is the population standard deviation of all 2n objectives, or with `paired_spread` that of each about its
    pair's mean: the root of mean_i ((R+_i - R-_i) / 2)^2. Where it is 0, theta stays. With `top`, n and s are those
    of the directions that count.
    Directions are drawn again one at a time, so memory is O(d).

    Where pairs were dropped, n and s are those of the rest. The step is made of differences within whole
    pairs, so whatever both sides share (the level of the rewards, all that is even in delta) cancels,
    whichever side failed. Where failing depends on the candidate alone, delta_i and -delta_i are dropped
    equally often: E[delta_i | kept] = 0. The step is that of n' pairs on the condition that both sides
    finish. Where finishing does not depend on the candidate, the condition changes nothing:
    sum_i (R+_i - R-_i) delta_i / n' has the undisturbed mean. Where it does, the step is not driven from
    what breaks episodes off by the level of the rewards; it is shorter along it.

    Raises:
        ValueError: the objectives have another shape, are not finite but for dropped pairs, or none is left.
    """
    n = config.directions
    if objectives.shape != (n, 2):
        raise ValueError(f"objectives must be of shape ({n}, 2), not {objectives.shape}")
    dropped: NDArray[np.bool_] = np.logical_and(*np.isnan(objectives).T)
    kept = objectives[~dropped]
    if not len(kept) or not np.isfinite(kept).all():
        raise ValueError(f"objectives must be finite but for dropped pairs, and not all may be: {n - len(kept)} of {n}")
    counts = _counting(objectives, ~dropped, config.top)
    kept = objectives[counts]
    spread = float((kept - kept.mean(axis=1, keepdims=True)).std() if config.paired_spread else kept.std())
    if spread == 0.0:
        return theta.copy()
    step = np.zeros(scope.size(len(theta)))
    delta, weighted = np.empty(len(step), dtype=np.float32), np.empty(len(step))
    for index, (plus, minus) in enumerate(objectives):
        if counts[index] and plus != minus:
            _keyed(config.seed, _DIRECTION, update, index).standard_normal(dtype=np.float32, out=delta)
            step += np.multiply(delta, plus - minus, out=weighted, dtype=np.float64)
    step *= config.alpha_at(update) / (len(kept) * spread)
    moved, start = theta.copy(), scope.start
    new = scope.scaled(theta.astype(np.float64), 1.0 + step) if scope.gains else theta[start:] + step
    moved[start:] = new.astype(np.float32)
    return moved


def _counting(objectives: NDArray[np.float64], kept: NDArray[np.bool_], top: int) -> NDArray[np.bool_]:
    """Which directions (n,) count: of those that are kept the best `top` by their better side, or all for 0."""
    places = np.flatnonzero(kept)
    if not 0 < top < len(places):
        return kept
    best = np.argsort(-objectives[places].max(axis=1), kind="stable")[:top]
    counts = np.zeros_like(kept)
    counts[places[best]] = True
    return counts
