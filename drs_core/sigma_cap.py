"""Keeps sigma so small that no candidate changes an action by more than an arm should be asked for.

Judged on observations that were recorded: before a candidate ever moves anything, every action that
it would have given there is compared with that of theta.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.policy import Float32
from drs_core.search import Perturbation

RESOLUTION = 1e-3
"""A capped sigma lies at most this part below one that breaks the cap."""
_SMALLEST = 1e-6


@dataclass(frozen=True)
class Capped:
    """A sigma, and the largest change of an action that it causes [unit of the action]."""

    sigma: float
    change: float


class ActionChange:
    """Asks candidates for their actions, in the very arithmetic of an episode; memory is O(d)."""

    def __init__(self, agent: Agent, seen: Float32) -> None:
        """Of this agent's network, on `seen` (n, n_features) float32, what its policy saw."""
        self._policy, self._seen = agent.policy(), seen
        shape = (len(seen), len(agent.low))
        self._before, self._after = np.empty(shape, np.float32), np.empty(shape, np.float32)

    def around(self, theta: Float32) -> Callable[[Perturbation], float]:
        """Perturbation -> the largest |a - a'| over observations and actions, a by theta, a' by the candidate."""
        self._act(theta, self._before)

        def change(perturbation: Perturbation) -> float:
            self._act(perturbation.candidate(theta), self._after)
            return float(np.abs(self._after.astype(np.float64) - self._before).max())

        return change

    def _act(self, theta: Float32, actions: Float32) -> None:
        self._policy.load(theta)
        for features, action in zip(self._seen, actions, strict=True):
            self._policy.act(features, action)


def capped_sigma(change: Callable[[Perturbation], float], perturbations: Sequence[Perturbation], most: float) -> Capped:
    """The largest sigma, up to the perturbations' own, at which none of them changes an action by more than `most`.

    Where that is sigma_k, it is sigma_k to the bit. Otherwise it is found by halving an interval, to
    RESOLUTION. A network need not change its actions more for a larger sigma; where it does not, a
    larger one may be allowed too. The one returned was tried with every perturbation.

    Args:
        change: as `ActionChange.around` gives it.
        perturbations: of one update, all with its sigma_k.
        most: above 0 [unit of the action].

    Raises:
        UsageError: even a millionth of sigma_k breaks the cap.
    """
    sigma = perturbations[0].sigma
    while True:
        lowered, largest = False, 0.0
        for perturbation in perturbations:
            found = change(replace(perturbation, sigma=sigma))
            # also where it is not a number
            if not found <= most:
                sigma, lowered = _below(change, perturbation, sigma, most), True
            else:
                largest = max(largest, found)
        if not lowered:
            return Capped(sigma, largest)


def _below(change: Callable[[Perturbation], float], perturbation: Perturbation, high: float, most: float) -> float:
    low = 0.0
    while high - low > RESOLUTION * low:
        middle = 0.5 * (low + high)
        if middle < _SMALLEST * perturbation.sigma:
            raise UsageError(
                f"action_change_max is {most:g}, and no sigma changes the actions so little; allowed is more, or 0 "
                "for no cap."
            )
        if change(replace(perturbation, sigma=middle)) <= most:
            low = middle
        else:
            high = middle
    return low
