"""What the records say: rollouts until the goal, over the tuning seeds."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any

from drs_core.bench.sample_cost.agents import Subject
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.counting import within
from drs_core.bench.sample_cost.job import Job
from drs_core.bench.sample_cost.methods import chosen


def result(
    config: SampleCostConfig, subjects: Sequence[Subject], missing: Sequence[str], work: Sequence[Job]
) -> dict[str, Any]:
    """The keys of ``drs bench --sample-cost --json``.

    A search that spent all its rollouts without reaching its goal has the cost None, and counts as more than
    any other in the median; one that has not come to its end has none at all.
    """
    agents = {}
    for subject in subjects:
        of_agent = [job for job in work if job.agent is subject.agent]
        methods = {
            name: _of_method([job for job in of_agent if job.entry is entry])
            for name, entry in chosen(config.methods).items()
        }
        goal = {"objective": subject.goal.objective, "label": subject.goal.label, "line": subject.goal.line}
        agents[subject.name] = {"goal": goal, "backend": subject.backend, "methods": methods}
    return {
        "rollouts": config.rollouts,
        "seeds": config.seeds,
        "titles": {name: entry.title for name, entry in chosen(config.methods).items()},
        "agents": agents,
        "missing": list(missing),
    }


def _of_method(jobs: Sequence[Job]) -> dict[str, Any]:
    costs: list[int | None] = []
    seeds, curves = [], []
    for job in jobs:
        counts = within(job.records(), job.most)
        curves.append([[look["rollouts"], look["shown"]] for look in counts.looks])
        if counts.ended:
            seeds.append(job.seed)
            costs.append(counts.done if counts.looks[-1]["reached"] else None)
    numbers = [math.inf if cost is None else float(cost) for cost in costs]
    median = statistics.median(numbers) if numbers else None
    return {
        "costs": costs,
        "seeds": seeds,
        "most": max((job.most for job in jobs), default=0),
        "median": int(median) if median is not None and math.isfinite(median) else None,
        "reached": sum(cost is not None for cost in costs),
        "ended": len(costs),
        "curves": curves,
    }
