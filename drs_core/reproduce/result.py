"""What ``drs reproduce --json`` says, from what the rows have kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from drs_core.reproduce.config import ReproduceConfig
from drs_core.reproduce.job import AFTER, BEFORE, Job
from drs_core.reproduce.kept import Kept
from drs_core.reproduce.origin import records
from drs_core.reproduce.paper import PaperRow, table
from drs_core.reproduce.verdict import against_paper, gain, own_interval
from drs_core.versions import installed

Result = dict[str, Any]


def result(config: ReproduceConfig, command: str, jobs: Sequence[Job], skipped: Mapping[str, str]) -> Result:
    """Everything, row by row in the paper's order; command and versions are those of now, rows name their own."""
    return {
        "table": config.table,
        "title": table(config.table).title,
        "command": command,
        "versions": installed(),
        "updates_asked": config.updates,
        "episodes": config.trials,
        "rows": [row_result(job, config) for job in jobs],
        "skipped": dict(skipped),
    }


def row_result(job: Job, config: ReproduceConfig) -> Result:
    """One row: how far it has come, and its quantities beside the paper's."""
    tuned, history = job.tuned(), job.history()
    before, after = job.evaluated(BEFORE), job.evaluated(AFTER)
    return {
        "number": job.row.number,
        "row": job.row.name,
        "environment": job.row.environment,
        "algorithm": job.row.algorithm,
        "agent": job.baseline.name,
        "backend": job.backend,
        "stop_reason": job.stop_reason(),
        "updates": len(history),
        "rollouts": 2 * job.settings.directions * len(history),
        "wall_s": sum(record["wall_s"] for record in history),
        "tuned_agent": tuned.which if tuned else None,
        "tuned_update": tuned.update if tuned else None,
        "folder": str(job.path),
        "made_with": records(job.made_with()),
        "quantities": {name: _quantity(name, job.row, before, after, config) for name in job.row.printed},
    }


def _quantity(name: str, row: PaperRow, before: Kept | None, after: Kept | None, config: ReproduceConfig) -> Result:
    baseline, tuned = row.printed[name]
    found: Result = {
        "paper_before": baseline.mean,
        "paper_before_std": baseline.std,
        "paper_after": tuned.mean,
        "paper_after_std": tuned.std,
    }
    for stage, kept in ((BEFORE, before), (AFTER, after)):
        values = kept.values(name, config.trials) if kept else None
        found[stage] = None if values is None else float(values.mean())
        found[f"{stage}_std"] = None if values is None else float(values.std(ddof=1))
        found[f"{stage}_ci95"] = None if values is None else list(own_interval(name, values))
    paper_trials = table(config.table).episodes
    keys = ("baseline_mark", "gain", "gain_ci95", "difference_to_paper", "difference_to_paper_ci95", "mark")
    found |= dict.fromkeys(keys)
    if before:
        found["baseline_mark"] = against_paper(name, before.values(name, config.trials), baseline, paper_trials).mark
    if before and after:
        ours = after.values(name, config.trials)
        found["gain"], interval = gain(before.values(name, config.trials), ours)
        verdict = against_paper(name, ours, tuned, paper_trials)
        found |= {
            "gain_ci95": list(interval),
            "difference_to_paper": verdict.difference,
            "difference_to_paper_ci95": list(verdict.interval),
            "mark": verdict.mark,
        }
    return found
