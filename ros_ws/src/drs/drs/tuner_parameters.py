"""The tuner's parameters, and what a run is made of from them and from a goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from drs_interfaces.action import Tune

from drs.agent_names import plain_name, requested_agent
from drs.declare import Declared
from drs_core.accelerator import BACKENDS
from drs_core.agent import Agent
from drs_core.budget import MOST_RESET_S
from drs_core.objective import OBJECTIVES
from drs_core.observed import Observe
from drs_core.recording.observed import of_recording
from drs_core.rollouts.attempts import ATTEMPTS, MAX_ATTEMPTS
from drs_core.run_settings import run_settings
from drs_core.search import MAX_DIRECTIONS, MAX_UPDATES
from drs_core.tune_config import MOST_WEIGHT, TuneConfig

_MOST = 2**63 - 1

PARAMETERS = (
    Declared("agent", "panda_reach", "agent to tune and to evaluate: a shipped name or a file"),
    Declared("agents_root", "runs", "folder for agents and run folders that requests name"),
    Declared("autostart", False, "tune as soon as the node runs"),
    Declared("exit_when_done", False, "end the node when the run that autostart began is done"),
    Declared("output", "runs/tuner", "run folder; a run of the same settings that is there is continued"),
    Declared("objective", "return", "what to maximise", allowed=tuple(OBJECTIVES)),
    Declared("smoothness_weight", 0.0, "c of the objective smooth; 0: from the agent's own figures", 0.0, MOST_WEIGHT),
    Declared("updates", 200, "K, updates of a run", 1, MAX_UPDATES),
    Declared("budget", "", "robot time of a run in place of updates, such as 90s, 20min or 1h30min; empty: updates"),
    Declared("reset_seconds", 0.0, "time between two episodes that counts against the budget [s]", 0.0, MOST_RESET_S),
    Declared("directions", 64, "n, directions of an update, two rollouts each", 1, MAX_DIRECTIONS),
    Declared("alpha", [0.0, 0.0], "step size of the first and the last update, to 1000; zeros: the objective's own"),
    Declared("sigma", [0.0, 0.0], "perturbations' standard deviation, first and last, to 1000; zeros: as above"),
    Declared("seed", 0, "of every random number of a run", 0, _MOST),
    Declared("last_layer", False, "perturb and move the last layer only"),
    Declared("action_gains", False, "perturb and move the gain of each action only"),
    Declared("top", 0, "b, only the directions count whose better side is best; 0: all", 0, MAX_DIRECTIONS),
    Declared("paired_spread", False, "divide a step by the spread within pairs, not by that of all objectives"),
    Declared("back_off", False, "where the search gets lost: back to the best agent, with more careful steps"),
    Declared("evaluate_every", 10, "updates between evaluations during a run; 0: none", 0, 1_000_000),
    Declared("evaluation_episodes", 100, "episodes of an evaluation", 1, 1_000_000),
    Declared("stop_when_flat", False, "end a run when evaluations show that more rollouts hardly help"),
    Declared("backend", "python", "what runs episodes; a simulator that cannot takes no part", allowed=BACKENDS),
    Declared("attempts", ATTEMPTS, "how often a pair that is broken off is run before it is dropped", 1, MAX_ATTEMPTS),
    Declared("action_change_max", 0.0, "sigma is lowered where an action would change by more; 0: no cap", 0.0, 1e6),
    Declared("observations", "", "recording that the cap is judged on, *.mcap; empty: simulated episodes"),
    Declared("pause_each_update", False, "wait for ~/resume before every update, and whatever else moves"),
    Declared("evaluation_seed", 0, "first episode seed of /evaluate", 0, 2**62),
    Declared("call_deadline_s", 30.0, "a simulator that owes an answer for longer is taken for hung [s]", 1.0, 3600.0),
    Declared("evaluation_patience_s", 30.0, "/evaluate gives up after so long without a simulator [s]", 1.0, 1e6),
)


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes:
        name, agent: what to begin with.
        config: the settings.
        output: where it is kept.
        observe: what reads a recording for it, if any.
        stop_when_flat: whether it may end before its last update.
        plan: what a budget comes to, for people; empty without one.
    """

    name: str
    agent: Agent
    config: TuneConfig
    output: Path
    observe: Observe | None = None
    stop_when_flat: bool = False
    plan: str = ""


def job_from(parameters: Mapping[str, Any], goal: Tune.Goal | None = None) -> Job:
    """The run that the parameters describe, with what a goal sets in their place.

    Raises:
        UsageError: a value is out of range, a budget too small, or there is no such agent.
    """
    p = dict(parameters)
    requested, output = "", Path(p["output"])
    if goal is not None:
        fields = ("objective", "smoothness_weight", "updates", "directions", "seed")
        p |= {name: getattr(goal, name) for name in fields if getattr(goal, name)}
        if goal.updates:
            p["budget"] = ""
        requested = goal.agent
        if goal.output:
            output = Path(p["agents_root"]) / plain_name(goal.output)
    name, agent = requested_agent(requested, p["agent"], p["agents_root"])
    schedule = {key: tuple(p.pop(key)) for key in ("alpha", "sigma")}
    given = {key: pair for key, pair in schedule.items() if any(pair)}
    observe = partial(of_recording, Path(p["observations"]), agent) if p["observations"] else None
    settings = run_settings(p | given)
    config, plan = settings.planned(agent.environment)
    return Job(name, agent, config, output, observe, settings.stop_when_flat, plan)
