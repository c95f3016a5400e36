"""What the tuner and a simulator spend beside the episodes, as measured, and the file that keeps it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from drs_core.errors import UsageError
from drs_core.files import write_atomically

AGENTS = ("Hopper", "PandaReach")


@dataclass(frozen=True)
class Costs:
    """Costs of one agent [s].

    Attributes:
        turn_s: of a turn of the tuner's loop, which takes one answer.
        turn_link_s: more of it for every simulator: each is looked at, and fed.
        wake_s: of the executor that receives an answer.
        wake_link_s: more of it for every simulator: its clients are in the set that is waited for.
        scan_call_s: of an idle simulator's look at one call of another one, whether it is late.
        graph_link_s: of a look at the graph, for every simulator.
        send_call_s: of making and sending a batch.
        send_episode_s: more of it for every episode.
        take_call_s: of checking and converting an answer.
        take_episode_s: more of it for every episode, receiving included.
        theta_s: of making and sending theta to one simulator.
        update_s: of an update's search and record.
        direction_s: more of it for every direction: two tasks, two objectives, its share of the step.
        simulator_call_s: of a call, in the simulator.
        simulator_episode_s: more of it for every episode.
        simulator_theta_s: of taking theta, in the simulator.
    """

    turn_s: float = 0.0
    turn_link_s: float = 0.0
    wake_s: float = 0.0
    wake_link_s: float = 0.0
    scan_call_s: float = 0.0
    graph_link_s: float = 0.0
    send_call_s: float = 0.0
    send_episode_s: float = 0.0
    take_call_s: float = 0.0
    take_episode_s: float = 0.0
    theta_s: float = 0.0
    update_s: float = 0.0
    direction_s: float = 0.0
    simulator_call_s: float = 0.0
    simulator_episode_s: float = 0.0
    simulator_theta_s: float = 0.0

    def __post_init__(self) -> None:
        """Raise UsageError with the name and value of a cost that is none."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise UsageError(f"{field.name} is {value}; a cost is a finite number of seconds, 0 or more.")


def load_costs(path: Path) -> dict[str, Costs]:
    """Agent -> its costs."""
    return {agent: Costs(**found) for agent, found in json.loads(path.read_text())["agents"].items()}


def save_costs(path: Path, agents: dict[str, dict[str, float]], about: dict[str, Any]) -> None:
    """Keep the costs of every agent, to four digits, and how they were measured."""
    rounded = {agent: {name: float(f"{value:.4g}") for name, value in found.items()} for agent, found in agents.items()}
    write_atomically(path, (json.dumps({**about, "agents": rounded}, indent=2) + "\n").encode())
