"""The methods of search that are compared: ours with one thing changed, and others' by their libraries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from typing import Any, cast

from drs_core.agent import Agent
from drs_core.bench.sample_cost.methods.direct import EPISODES, Direct
from drs_core.bench.sample_cost.methods.method import Method
from drs_core.errors import DrsError, UsageError, install
from drs_core.search import SearchConfig

PAPER = SearchConfig()
FRUGAL = SearchConfig(updates=320, directions=8, top=4)
"""As in params/frugal.yaml: the paper's step sizes, an eighth of its directions, and the better half of them counts."""

_MODULES = {"sep_cma": "cma_es", "pgpe": "evotorch", "snes": "evotorch"}
"""Of the kinds that are others'."""


@dataclass(frozen=True)
class Entry:
    """One method; settings are those of the search where they do not say otherwise.

    Attributes:
        title: as tables call it.
        kind: which class or library.
        config: n, alpha, sigma and the schedule.
        back_off: to the best agent where it gets lost.
    """

    title: str
    kind: str
    config: SearchConfig = field(default_factory=lambda: FRUGAL)
    back_off: bool = False

    @property
    def rollouts(self) -> int:
        """The most that are counted: its updates'. Evaluations by which it steers count, and leave the last out."""
        return 2 * self.config.directions * self.config.updates

    @property
    def first(self) -> int:
        """Of the first update, with the evaluation by which it steers; others take as many at most.

        One in a search evaluates its start again, which comes on top.
        """
        return 2 * self.config.directions + (EPISODES if self.back_off else 0)

    def settings(self, seed: int) -> Mapping[str, Any]:
        """What identifies it."""
        more = {"back_off": True} if self.back_off else {}
        return {"kind": self.kind, **more, **asdict(replace(self.config, seed=seed))}

    def make(self, seed: int, agent: Agent) -> Method:
        """The method, at its start.

        Raises:
            DrsError: its library is not installed.
        """
        config, theta = replace(self.config, seed=seed), agent.theta
        if self.is_ours:
            scope = agent.network.scope(config.last_layer, config.action_gains)
            return Direct(config, theta, scope, self.back_off)
        size, sigma, alpha = 2 * config.directions, config.sigma[0], config.alpha[0]
        if self.kind == "sep_cma":
            return cast(Method, self.library().SepCma(seed, theta, size, sigma))
        return cast(Method, self.library().EvoTorch(self.kind, seed, theta, size, sigma, alpha))

    @property
    def is_ours(self) -> bool:
        """Whether it needs no other library."""
        return self.kind not in _MODULES

    def library(self) -> Any:
        """The module of a method that is another's.

        Raises:
            DrsError: its library, or what that is built on, is not installed.
        """
        try:
            return import_module(f"{__name__}.{_MODULES[self.kind]}")
        except ModuleNotFoundError as error:
            needed = (error.name or "").partition(".")[0]
            raise DrsError(f"{self.title} needs {needed}; {install('peers')}.") from error


METHODS: Mapping[str, Entry] = {
    "paper": Entry("the paper's settings", "direct", PAPER),
    "frugal": Entry("frugal", "direct", back_off=True),
    "top4": Entry("n = 8, the better 4 count", "direct"),
    "smooth": Entry(
        "frugal_smooth",
        "direct",
        SearchConfig(20, 8, alpha=(0.03, 0.008), sigma=(0.06, 0.02), last_layer=True, paired_spread=True),
    ),
    "all": Entry("all directions count", "direct", replace(FRUGAL, top=0)),
    "n4": Entry("n = 4, all count", "direct", replace(FRUGAL, directions=4, updates=640, top=0)),
    "n16": Entry("n = 16, all count", "direct", replace(FRUGAL, directions=16, updates=160, top=0)),
    "last_layer": Entry(
        "last layer, all count",
        "direct",
        replace(FRUGAL, alpha=(0.05, 0.005), sigma=(0.05, 0.005), last_layer=True, top=0),
    ),
    "sep_cma": Entry("sep-CMA-ES (cma)", "sep_cma"),
    "pgpe": Entry("PGPE (EvoTorch)", "pgpe"),
    "snes": Entry("SNES (EvoTorch)", "snes"),
}


def chosen(names: tuple[str, ...]) -> dict[str, Entry]:
    """The methods of these names.

    Raises:
        UsageError: there is none, or one of them is unknown.
    """
    if not names:
        raise UsageError(f"No method is named; choose some of {', '.join(METHODS)}.")
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise UsageError(f"There is no method {unknown[0]!r}; choose some of {', '.join(METHODS)}.")
    return {name: METHODS[name] for name in names}
