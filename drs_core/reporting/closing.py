"""What a command that has ended tells to do next."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drs_core.run_folder import RunFolder


def look_at(name: str, run: RunFolder) -> str:
    """How to look at a run of the agent `name`: at its best agent, unless that is the one that it began with."""
    from drs_core.agent import load
    from drs_core.run_folder import updates_done

    better = run.best.exists() and updates_done(load(run.best)) > 0
    which, seen = ("best of its evaluations", run.best) if better else ("newest agent", run.agent)
    evaluated = bool(run.newest_evaluation()) and not better
    why = "No evaluation has found a better one than the start. " if evaluated else ""
    report = shlex.join(["drs", "report", str(run.path), *(["--after", "best"] if better else [])])
    return f"{why}Look at the {which} with: {report}, or {shlex.join(['drs', 'compare', name, str(seen)])}"
