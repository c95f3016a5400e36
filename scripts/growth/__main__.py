"""How throughput grows with the number of simulators: `python -m scripts.growth STEP ...` from the checkout.

    episodes NAME=AGENT ...   measures episodes of an update              -> growth_episodes.csv
    costs NAME=AGENT ...      measures the tuner, with hollow simulators   -> growth_costs.json
    points                    the model's throughput                       -> growth.csv
    check NAME=AGENT ...      the model beside real simulator nodes        -> growth_check.csv
    crowd NAME=AGENT          the model beside many nodes that sleep       -> growth_crowd.csv
    figure                    draws the points                             -> growth.png

`episodes`, `points` and `figure` need no ROS 2; the others need its environment (source install/setup.bash).
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from drs_core.bench.machine import machine
from drs_core.errors import DrsError, UsageError
from drs_core.files import write_atomically
from drs_core.importing import resolve
from scripts.growth.costs import Costs, load_costs, save_costs
from scripts.growth.episodes import load_episodes, measure_episodes, save_episodes
from scripts.growth.figure import growth_figure
from scripts.growth.points import SIMULATORS, load_points, save_points, sweep
from scripts.growth.rules import ROOT, product_rules

_FLEETS, _SHORT_FLEETS = (1, 4, 16, 48), (1, 2)
_ROUNDS, _SHORT_ROUNDS = 2, 1
_CHECKED = (1, 2)
_CROWDS = (8, 16, 32, 48, 64)
_SHORT_SIMULATORS = (1, 4)


def _agents(words: Sequence[str]) -> dict[str, str]:
    agents = {}
    for word in words:
        name, equals, agent = word.partition("=")
        if not (name and equals and agent):
            raise UsageError(f"An agent is given as NAME=AGENT, such as PandaReach=panda_reach; {word!r} is not.")
        agents[name] = agent
    if not agents:
        raise UsageError("No agent is given; name one, such as PandaReach=panda_reach.")
    return agents


def _episodes(options: argparse.Namespace) -> None:
    directions = 2 if options.short else options.directions
    found = [
        episode
        for name, agent in _agents(options.agents).items()
        for episode in measure_episodes(name, resolve(agent), directions)
    ]
    save_episodes(options.results / "growth_episodes.csv", found)


def _costs(options: argparse.Namespace) -> None:
    from scripts.growth.search_costs import measure_search
    from scripts.growth.tuner_costs import fit, measure_fleet, services_of_a_simulator

    fleets, rounds = (_SHORT_FLEETS, _SHORT_ROUNDS) if options.short else (_FLEETS, _ROUNDS)
    agents = _agents(options.agents)
    found, looks = [], []
    for count in fleets:
        measured, look_s = measure_fleet(next(iter(agents.values())), count, rounds)
        found += measured
        looks.append(look_s)
        print(f"measured {count} hollow simulators", file=sys.stderr)
    services = services_of_a_simulator()
    shared = fit(found, max(looks), services)
    costs = {name: {**shared, **measure_search(resolve(agent), rounds)} for name, agent in agents.items()}
    rows = [one.row() for one in found]
    about = {"machine": machine(), "services_of_a_simulator": services, "measured": rows}
    save_costs(options.results / "growth_costs.json", costs, about)


def _points(options: argparse.Namespace) -> None:
    counts = _SHORT_SIMULATORS if options.short else SIMULATORS
    found = sweep(
        _known_costs(options), load_episodes(options.results / "growth_episodes.csv"), product_rules(), counts
    )
    save_points(options.results / "growth.csv", found)


def _check(options: argparse.Namespace) -> None:
    from scripts.growth.validate import check

    costs, pairs = _known_costs(options), load_episodes(options.results / "growth_episodes.csv")
    rows = [
        asdict(check(name, resolve(agent), count, options.directions, 3, pairs[name], costs[name], product_rules()))
        for _ in range(_SHORT_ROUNDS if options.short else _ROUNDS)
        for name, agent in _agents(options.agents).items()
        for count in _CHECKED
    ]
    _write(options.results / "growth_check.csv", rows)


def _crowd(options: argparse.Namespace) -> None:
    from scripts.growth.crowd import crowd

    ((name, agent),) = _agents(options.agents).items()
    costs = _known_costs(options)[name]
    _write(options.results / "growth_crowd.csv", [asdict(crowd(agent, n, costs, product_rules())) for n in _CROWDS])


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: f"{v:.4g}" if isinstance(v, float) else v for key, v in row.items()} for row in rows)
    write_atomically(path, text.getvalue().encode())


def _figure(options: argparse.Namespace) -> None:
    growth_figure(load_points(options.results / "growth.csv"), options.figure)


def _known_costs(options: argparse.Namespace) -> dict[str, Costs]:
    return load_costs(options.results / "growth_costs.json")


STEPS: dict[str, Callable[[argparse.Namespace], None]] = {
    "episodes": _episodes,
    "costs": _costs,
    "points": _points,
    "check": _check,
    "crowd": _crowd,
    "figure": _figure,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Do one step; a mistake ends with a sentence."""
    parser = argparse.ArgumentParser(
        prog="python -m scripts.growth", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("step", choices=STEPS)
    parser.add_argument("agents", nargs="*", metavar="NAME=AGENT", help="an agent, and what it is called")
    parser.add_argument("--results", type=Path, default=ROOT / "docs" / "results", help="folder of the files")
    parser.add_argument("--figure", type=Path, default=ROOT / "docs" / "images" / "growth.png", help="the picture")
    parser.add_argument("--directions", type=int, default=64, help="of an update that is measured")
    parser.add_argument("--short", action="store_true", help="a few seconds of it, to see whether it works")
    options = parser.parse_intermixed_args(arguments)
    try:
        if options.step in ("costs", "check", "crowd"):
            from scripts.growth.nodes import own_domain

            own_domain()
        STEPS[options.step](options)
    except (DrsError, OSError) as error:
        sys.exit(f"growth: {error}")


if __name__ == "__main__":
    main()
