"""The methods of search that are compared: ours with one thing changed, and others' by their libraries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from typing import Any, cast

from drs_core.agent import Agent
from drs_core.bench.sample_cost.methods import direct
from drs_core.bench.sample_cost.methods.method import Method
from drs_core.bench.sample_cost.methods.tail import Tail
from drs_core.errors import DrsError, UsageError
from drs_core.policy import Float32
from drs_core.search import SearchConfig

PAPER = SearchConfig()
FRUGAL = SearchConfig(updates=320, directions=8)
"""As in params/frugal.yaml: the paper's step sizes, an eighth of its directions."""


@dataclass(frozen=True)
class Entry:
    """One method; settings are those of the search where they do not say otherwise.

    Attributes:
        title: as tables call it.
        kind: which class or library.
        config: n, alpha, sigma and the schedule.
    """

    title: str
    kind: str
    config: SearchConfig = field(default_factory=lambda: FRUGAL)

    @property
    def rollouts(self) -> int:
        """Of its whole schedule."""
        return 2 * self.config.directions * self.config.updates

    def settings(self, seed: int) -> Mapping[str, Any]:
        """What identifies it."""
        return {"kind": self.kind, **asdict(replace(self.config, seed=seed))}

    def make(self, seed: int, agent: Agent) -> Method:
        """The method, at its start.

        Raises:
            DrsError: its library is not installed.
        """
        config = replace(self.config, seed=seed)
        if not config.last_layer:
            return self._begin(config, agent.theta)
        start = agent.network.last_layer_start
        return Tail(self._begin(config, agent.theta[start:]), agent.theta[:start])

    def _begin(self, config: SearchConfig, theta: Float32) -> Method:
        if self.kind in _OURS:
            return _OURS[self.kind](config, theta)
        size, sigma, alpha = 2 * config.directions, config.sigma[0], config.alpha[0]
        if self.kind == "sep_cma":
            return cast(Method, _library("cma_es").SepCma(config.seed, theta, size, sigma))
        return cast(Method, _library("evotorch").EvoTorch(self.kind, config.seed, theta, size, sigma, alpha))


_OURS: Mapping[str, Callable[[SearchConfig, Float32], Method]] = {
    "direct": direct.Direct,
    "top": direct.TopDirections,
    "ranks": direct.Ranks,
    "orthogonal": direct.Orthogonal,
    "momentum": direct.Momentum,
    "adam": direct.Adam,
    "guided": direct.Guided,
}

METHODS: Mapping[str, Entry] = {
    "paper": Entry("the paper's settings", "direct", PAPER),
    "frugal": Entry("frugal", "direct"),
    "n4": Entry("n = 4", "direct", replace(FRUGAL, directions=4, updates=640)),
    "n16": Entry("n = 16", "direct", replace(FRUGAL, directions=16, updates=160)),
    "n32": Entry("n = 32", "direct", replace(FRUGAL, directions=32, updates=80)),
    "alpha_half": Entry("alpha halved", "direct", replace(FRUGAL, alpha=(0.01, 0.001))),
    "alpha_double": Entry("alpha doubled", "direct", replace(FRUGAL, alpha=(0.04, 0.004))),
    "sigma_half": Entry("sigma halved", "direct", replace(FRUGAL, sigma=(0.0125, 0.00125))),
    "sigma_double": Entry("sigma doubled", "direct", replace(FRUGAL, sigma=(0.05, 0.005))),
    "constant": Entry("no schedule", "direct", replace(FRUGAL, alpha=(0.02, 0.02), sigma=(0.025, 0.025))),
    "last_layer": Entry(
        "last layer", "direct", replace(FRUGAL, alpha=(0.05, 0.005), sigma=(0.05, 0.005), last_layer=True)
    ),
    "top": Entry("better half of the directions", "top"),
    "ranks": Entry("ranks", "ranks"),
    "orthogonal": Entry("orthogonal directions", "orthogonal"),
    "momentum": Entry("momentum", "momentum"),
    "adam": Entry("Adam", "adam"),
    "guided": Entry("guided by past steps", "guided"),
    "sep_cma": Entry("sep-CMA-ES (cma)", "sep_cma"),
    "pgpe": Entry("PGPE (EvoTorch)", "pgpe"),
    "snes": Entry("SNES (EvoTorch)", "snes"),
}


def chosen(names: tuple[str, ...]) -> dict[str, Entry]:
    """The methods of these names.

    Raises:
        UsageError: one of them is unknown.
    """
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise UsageError(f"There is no method {unknown[0]!r}; choose some of {', '.join(METHODS)}.")
    return {name: METHODS[name] for name in names}


def _library(module: str) -> Any:
    try:
        return import_module(f"{__name__}.{module}")
    except ModuleNotFoundError as error:
        needed = (error.name or "").partition(".")[0]
        raise DrsError(f"This method needs {needed}; install it with: pip install 'drs[peers]'.") from error
