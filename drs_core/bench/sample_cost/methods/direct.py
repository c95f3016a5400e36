"""Direct random search: the product's own ask and tell, and its way of backing off."""

from __future__ import annotations

import math
from typing import Any

from drs_core import backing_off
from drs_core.bench.sample_cost.methods.method import Float64, Value
from drs_core.objective import BASELINE_EPISODES
from drs_core.policy import Float32
from drs_core.scope import Scope
from drs_core.search import SearchConfig, ask, baseline_seeds, evaluation_seeds, tell

EVERY = 10
EPISODES = 20
"""As in params/frugal.yaml: updates between evaluations, and episodes of one. Where they steer they are counted."""


class Direct:
    """The search of `drs_core.tuning`."""

    def __init__(self, config: SearchConfig, theta: Float32, scope: Scope, back_off: bool = False) -> None:
        """Begin at theta (d,); `scope` of it is searched."""
        self.theta, self._config, self._scope = theta.copy(), config, scope
        self._seeds = evaluation_seeds(config.seed, EPISODES) if back_off else []
        # as the product's records hold them
        self._updates: list[dict[str, Any]] = []
        self._evaluations: list[dict[str, Any]] = []
        self._begin = self._best = self.theta

    def update(self, value: Value) -> None:
        """Evaluate where that is due, go back where the search is lost, ask, tell."""
        done, backed_off = len(self._updates), dict[str, Any]()
        if self._seeds and done % EVERY == 0:
            self._evaluate(value)
            backed_off = self._back_off(value)
        times = backing_off.times([*self._updates, backed_off])
        config = backing_off.more_careful(self._config, times)
        asked = ask(config, done, self._scope)
        objectives = value((perturbation.candidate(self.theta), seed) for perturbation, seed in asked)
        self.theta = tell(config, done, self.theta, objectives.reshape(-1, 2), self._scope)
        self._updates.append(_figures(objectives) | backed_off)

    def _evaluate(self, value: Value) -> None:
        found = _figures(value((self.theta, seed) for seed in self._seeds))
        if found["objective_mean"] > max((e["objective_mean"] for e in self._evaluations), default=-math.inf):
            self._best = self.theta
        self._evaluations.append(found)

    def _back_off(self, value: Value) -> dict[str, Any]:
        start, again = backing_off.start_again(self._updates), dict[str, Any]()
        if start is None:
            if not backing_off.is_lost(self._updates, self._evaluations[0]):
                return {}
            seeds = baseline_seeds(self._config.seed, BASELINE_EPISODES)
            start = _figures(value((self._begin, seed) for seed in seeds))
            again = backing_off.kept(start)
        if not backing_off.is_lost(self._updates, start):
            return again
        self.theta = self._best
        return again | {backing_off.KEY: backing_off.times(self._updates) + 1}


def _figures(objectives: Float64) -> dict[str, Any]:
    return {"objective_mean": float(objectives.mean()), "objective_std": float(objectives.std())}
