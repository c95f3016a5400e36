"""Direct random search: the product's own ask and tell."""

from __future__ import annotations

from drs_core.bench.sample_cost.methods.method import Value
from drs_core.policy import Float32
from drs_core.search import SearchConfig, ask, tell


class Direct:
    """The search of `drs_core.search`."""

    def __init__(self, config: SearchConfig, theta: Float32, start: int) -> None:
        """Begin at theta (d,); parameters before `start` stay."""
        self.theta, self.rollouts = theta.copy(), 2 * config.directions
        self._config, self._start, self._done = config, start, 0

    def update(self, value: Value) -> None:
        """Ask, tell."""
        asked = ask(self._config, self._done, self._start)
        objectives = value((perturbation.candidate(self.theta), seed) for perturbation, seed in asked)
        self.theta = tell(self._config, self._done, self.theta, objectives.reshape(-1, 2), self._start)
        self._done += 1
