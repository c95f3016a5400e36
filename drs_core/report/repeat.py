"""What somebody needs to repeat a run, without the names of this machine's folders."""

from __future__ import annotations

import json
import shlex
from pathlib import PurePath
from typing import Any

from drs_core.agents import shipped
from drs_core.importing.hub import PREFIX
from drs_core.observed import RECORDING_SOURCE
from drs_core.report.gather import Findings
from drs_core.report.run import Run


def portable(name: str) -> str:
    """An agent's name as it was given, without the folders where it was a path."""
    return name if name in shipped() or name.startswith(PREFIX) else PurePath(name).name or name


def commands(findings: Findings) -> list[tuple[str, str]]:
    """(what it does, the command line)."""
    run, evaluation = findings.run, findings.before.evaluation
    name, output = shlex.quote(portable(run.name)), "runs/repeated"
    same = f"--episodes {len(evaluation.episodes)} --seed {evaluation.seed} --backend {run.config.backend}"
    stop = f" --stop-after {findings.done}" if 0 < findings.done < run.config.search.updates else ""
    tuned = shlex.quote(f"{output}/{findings.file}")
    return [
        ("Tune", f"drs tune {name} --output {output} {_options(run)}{stop}"),
        ("Compare, as in the table", f"drs compare {name} {tuned} {same}"),
        ("Evaluate one agent", f"drs evaluate {tuned} {same}"),
        ("Write this page", f"drs report {output} --episodes {len(evaluation.episodes)} --seed {evaluation.seed}"),
    ]


def _options(run: Run) -> str:
    given: list[str] = []
    for key, value in run.config.flat().items():
        option = "--" + key.replace("_", "-")
        if isinstance(value, bool):
            given += [option] if value else []
        elif isinstance(value, (list, tuple)):
            given += [option, *map(_text, value)]
        elif value is not None:
            given += [option, _text(value)]
    facts = run.folder.observations_facts()
    if facts and facts["source"] == RECORDING_SOURCE:
        given += ["--observations", "RECORDING.mcap"]
    return shlex.join(given)


def parameter_file(run: Run) -> str:
    """The run's settings as ``--params`` takes them."""
    flat = {key: value for key, value in run.config.flat().items() if value is not None}
    lines = [f"    {key}: {json.dumps(value)}" for key, value in flat.items()]
    return "\n".join(["/**:", "  ros__parameters:", *lines])


def _text(value: Any) -> str:
    return repr(value) if isinstance(value, float) else str(value)


def identities(findings: Findings) -> list[tuple[str, str]]:
    """(whose, digest) of everything that decides what an agent does."""
    return [(f"agent {side.label}", side.agent.digest()) for side in findings.sides]
