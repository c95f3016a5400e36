"""Where an agent comes from, and what a run did, as rows of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drs_core.agents import shipped
from drs_core.objective import BASELINE_EPISODES
from drs_core.report.gather import Findings
from drs_core.report.repeat import portable
from drs_core.report.verdict import number

Rows = list[tuple[str, str]]
_LONGEST, _DEEPEST = 600, 4

_OBJECTIVES = {
    "return": "return: the sum of rewards R",
    "dimension": "dimension: R / D, or R \N{MULTIPLICATION SIGN} D where R < 0; D is the mesh dimension",
    "smooth": "smooth: R \N{MINUS SIGN} c \N{MULTIPLICATION SIGN} mean |a(t) \N{MINUS SIGN} a(t\N{MINUS SIGN}1)|",
}


def tuned_how(findings: Findings) -> Rows:
    """What was tuned, and how."""
    run, search = findings.run, findings.run.config.search
    agent, done = findings.before.agent, findings.done
    rollouts = 2 * search.directions * done
    d, scope = len(agent.theta), agent.network.scope(search.last_layer, search.action_gains)
    tuned = f"the gains of {scope.gains} actions" if scope.gains else f"{scope.size(d):,} of {d:,} parameters"
    objective = _OBJECTIVES.get(run.config.objective.name, run.config.objective.name)
    if run.weight is not None:
        objective += f", c = {run.weight:.4g}"
    if run.config.objective.needs_baseline:
        objective += f" from {BASELINE_EPISODES} episodes of the agent before"
        rollouts += BASELINE_EPISODES
    wall_s = sum(record["wall_s"] for record in findings.history)
    sizes = "\N{MULTIPLICATION SIGN}".join(map(str, agent.network.sizes))
    return [
        ("Agent", f"{portable(run.name)}, {agent.source.get('algorithm', 'unknown algorithm')}"),
        ("Environment", f"{run.environment}, at most {findings.time_limit_steps} steps of {findings.step_s:.3g} s"),
        ("Policy", f"{sizes} ({agent.network.activation}); {tuned} tuned"),
        ("Method", "direct random search: both sides of random directions, antithetic, on the same episode seed"),
        ("Objective", objective),
        ("Updates", f"{done:,} of K = {search.updates:,} done, n = {search.directions:,} directions each"),
        ("Step size \N{GREEK SMALL LETTER ALPHA}", _ends(search.alpha)),
        ("Perturbation \N{GREEK SMALL LETTER SIGMA}", _ends(search.sigma)),
        ("Rollouts", f"{rollouts:,}, {_duration(rollouts * findings.time_limit_steps * findings.step_s)} at most "
                     f"of the robot's time; {_duration(wall_s)} on the clock"),
    ]  # fmt: skip


def _ends(values: tuple[float, float]) -> str:
    return f"{values[0]:g} \N{RIGHTWARDS ARROW} {values[1]:g}, linear"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def origin(findings: Findings) -> Rows:
    """What the agent's file says of where it comes from."""
    source = {str(key): _value(value) for key, value in findings.before.agent.source.items()}
    rows = [(key.replace("_", " "), value) for key, value in sorted(source.items())]
    if not {"license", "licence"} & set(source):
        known = findings.run.name in shipped()
        rows.append(("licence", "Apache-2.0, shipped with drs" if known else "not stated in the agent's file"))
    return rows


def history(findings: Findings) -> list[str]:
    """A sentence for every tuning run that made the agent, oldest first."""
    newest = findings.sides[-1].agent
    return [_tuning(record) for record in newest.tuning]


def _tuning(record: Mapping[str, Any]) -> str:
    keys = ("objective", "updates_done", "updates", "directions", "seed", "backend")
    objective, done, updates, directions, seed, backend = (_value(record.get(key, "?")) for key in keys)
    return f"{objective}: {done} of {updates} updates, {directions} directions, seed {seed}, backend {backend}"


def _value(value: Any) -> str:
    text = _text(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"


def _text(value: Any, depth: int = 0) -> str:
    """As people write it: no braces, quotes and sixteen digits. A file from elsewhere may nest as deep as it likes."""
    if depth > _DEEPEST:
        return "\N{HORIZONTAL ELLIPSIS}"
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    if isinstance(value, float):
        return number(value, ".4g")
    if isinstance(value, Mapping):
        text = ", ".join(f"{str(key).replace('_', ' ')} {_text(each, depth + 1)}" for key, each in value.items())
        return f"({text or 'none'})" if depth else text
    if isinstance(value, list | tuple):
        return "\N{MULTIPLICATION SIGN}".join(_text(each, depth + 1) for each in value)
    return str(value)
