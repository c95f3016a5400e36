"""Which backend runs an agent's episodes: chosen once by whoever starts a run, obeyed by its workers."""

from __future__ import annotations

import logging

from drs_core.accelerator.compiled import CompiledRunner, check_supported
from drs_core.accelerator.library import Unavailable
from drs_core.accelerator.self_check import check
from drs_core.agent import Agent
from drs_core.episode import Episode, EpisodeRunner
from drs_core.errors import DrsError, UsageError
from drs_core.policy import Float32

PYTHON, PLAIN, COMPILED = BACKENDS = ("python", "plain", "compiled")
"""Steps in Python; the same with upstream's own step, the same bits; whole episodes in the compiled helper."""


class Accelerated:
    """A `CompiledRunner` with the environment that it runs in, proved against the plain path."""

    def __init__(self, agent: Agent) -> None:
        """Make the agent's environment, hand it to the helper, and compare the two.

        Raises:
            UsageError: the agent does not fit its environment.
            Unavailable: the helper is missing, cannot run such an agent, or differs from the plain path.
        """
        check_supported(agent)
        self._plain = EpisodeRunner(agent, fast=False)
        try:
            self._compiled = CompiledRunner(agent, self._plain.environment)
            check(self._compiled, agent, self._plain.environment)
        except BaseException:
            self._plain.close()
            raise

    def load(self, theta: Float32) -> None:
        """Act with theta (d,) from now on."""
        self._compiled.load(theta)

    def run(self, seed: int, measure: frozenset[str] = frozenset()) -> Episode:
        """Run the episode of this seed; of `measure` only DIMENSION and ACTIONS are defined here.

        Raises:
            DrsError: the policy gave an action, or the environment a reward or observation, that is not finite.
        """
        return self._compiled.run(seed, measure)

    def close(self) -> None:
        """Free the simulator."""
        self._plain.close()


Runner = EpisodeRunner | Accelerated


def check_backend(backend: str) -> None:
    """Raise UsageError unless there is such a backend."""
    if backend not in BACKENDS:
        raise UsageError(f"backend is {backend!r}; allowed are {', '.join(BACKENDS)}.")


def choose(backend: str, agent: Agent) -> str:
    """The backend that will be in force: the one asked for, or with a line of log ``python``.

    Raises:
        UsageError: there is no such backend, or the agent does not fit its environment.
    """
    check_backend(backend)
    if backend == COMPILED:
        try:
            Accelerated(agent).close()
        except Unavailable as reason:
            logging.getLogger("drs").warning("Running without the accelerator: %s.", reason)
            return PYTHON
    return backend


def make_runner(agent: Agent, backend: str = PYTHON) -> Runner:
    """A runner of this backend and no other.

    Raises:
        UsageError: there is no such backend, or the agent does not fit its environment.
        DrsError: this process cannot run it.
    """
    check_backend(backend)
    if backend != COMPILED:
        return EpisodeRunner(agent, fast=backend == PYTHON)
    try:
        return Accelerated(agent)
    except Unavailable as reason:
        raise DrsError(
            f"The backend compiled cannot run here: {reason}. A run keeps one backend: mend it, or use python."
        ) from reason
