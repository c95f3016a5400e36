"""The whole benchmark: environment after environment, then whole updates."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from drs_core.bench.config import BenchConfig
from drs_core.bench.environment import bench_environment
from drs_core.bench.machine import machine
from drs_core.bench.updates import SEARCH_ENVIRONMENTS, objective_cost, search_share, tail
from drs_core.bench.variants import chosen


class Observer(Protocol):
    """Whoever watches a benchmark."""

    def on_part(self, name: str, turns: int) -> None:
        """A part of so many turns begins."""
        ...

    def on_turn(self) -> None:
        """A turn is done."""
        ...

    def on_message(self, text: str) -> None:
        """Something is left out."""
        ...


def run_bench(config: BenchConfig, observer: Observer) -> dict[str, Any]:
    """Measure everything; the keys are those of ``drs bench --json``.

    Raises:
        UsageError: a variant is unknown.
        DrsError: something that should run does not.
    """
    entries = chosen(config.variants)
    environments = {}
    for environment_id in config.environments:
        observer.on_part(environment_id, config.rounds * len(entries))
        environments[environment_id] = bench_environment(
            environment_id, config, entries, observer.on_message, observer.on_turn
        )
    updates = {}
    if config.updates:
        parts: dict[str, tuple[int, Callable[[BenchConfig, Callable[[], None]], Any]]] = {
            "dimension_over_return": (2, objective_cost),
            **{f"search_percent_{name}": (1, partial(search_share, name)) for name in SEARCH_ENVIRONMENTS},
            "tail_percent": (1, tail),
        }
        for name, (jobs, part) in parts.items():
            observer.on_part(name.replace("_", " "), config.rounds * jobs)
            updates[name] = part(config, observer.on_turn)
    return {
        "machine": machine(),
        "rounds": config.rounds,
        "titles": {name: entry.title for name, entry in entries.items()},
        "environments": environments,
        "updates": updates,
    }
