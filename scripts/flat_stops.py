"""What `--stop-when-flat` would have done to finished runs that went on to the end: stops, rollouts saved, false stops.

    python scripts/flat_stops.py runs/* > docs/results/flat_stops.csv

The rule sees EPISODES episodes of each evaluation; the others, which it never sees, judge it, so that a run
whose evaluations have many episodes is replayed several times. A stop is false where the best agent of the
whole run beats the best until the stop, both chosen by the episodes that are seen, by more than a tenth of the
baseline's standard deviation and of the whole run's gain.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drs_core.measures.statistics import percent_interval
from drs_core.report.run import Run, read_run
from drs_core.reproduce.stopping import stalled
from drs_core.stopping import flat

Record = dict[str, Any]
Rule = Callable[[Sequence[Record]], bool]


def seen(records: Sequence[Record], shown: slice) -> list[Record]:
    """The records of a run that had evaluated some of the episodes only."""
    parts = [record["objectives"][shown] for record in records]
    return [
        {"update": record["update"], "objectives": part, "objective_mean": float(np.mean(part))}
        for record, part in zip(records, parts, strict=True)
    ]


def stop_of(records: Sequence[Record], rule: Rule) -> int:
    """Index of the evaluation after which the rule ends the run; that of the last where it does not."""
    return next((at for at in range(len(records) - 1) if rule(records[: at + 1])), len(records) - 1)


def replays(name: str, run: Run, rule: Rule, episodes: int) -> list[Record]:
    """A row a group of episodes that the rule may see, as far as there are as many others to judge it."""
    count = len(run.evaluations[0]["objectives"])
    groups = count // episodes if count >= 2 * episodes else 0
    return [judged(name, run, rule, group, episodes) for group in range(groups)]


def judged(name: str, run: Run, rule: Rule, group: int, episodes: int) -> Record:
    """One row: where the rule ends the run, and what is lost by it, in units of the objective."""
    shown = slice(group * episodes, (group + 1) * episodes)
    records = seen(run.evaluations, shown)
    unseen = np.delete(np.array([record["objectives"] for record in run.evaluations]), shown, axis=1)
    at = stop_of(records, rule)
    means = [record["objective_mean"] for record in records]
    stopped, whole = int(np.argmax(means[: at + 1])), int(np.argmax(means))
    lost, gain = unseen[whole] - unseen[stopped], unseen[whole] - unseen[0]
    did_stop = at < len(records) - 1
    return {
        "run": name,
        "group": group,
        "environment": run.environment,
        "objective": run.config.objective.name,
        "directions": run.config.search.directions,
        "updates": run.config.search.updates,
        "stopped_after": records[at]["update"],
        "saved_percent": round(100.0 * (1.0 - records[at]["update"] / records[-1]["update"]), 1),
        "gain": round(float(gain.mean()), 3),
        "gain_error": round(_error(gain), 3),
        "lost": round(float(lost.mean()), 3),
        "lost_error": round(_error(lost), 3),
        "false_stop": int(did_stop and lost.mean() > 0.1 * max(float(unseen[0].std()), float(gain.mean()))),
        "stopped": int(did_stop),
    }


def _error(differences: np.ndarray) -> float:
    return float(differences.std(ddof=1) / np.sqrt(len(differences)))


def summary(label: str, rows: Sequence[Record]) -> str:
    """Stops, rollouts saved and the rate of false stops; the interval from one replay a run, since others depend."""
    each = [row for row in rows if row["group"] == 0]
    (once, once_false), (stops, false) = (
        [sum(row[key] for row in some) for key in ("stopped", "false_stop")] for some in (each, rows)
    )
    low, high = percent_interval(once_false, once) if once else (0.0, 100.0)
    return (
        f"{label}: {len(each)} runs, {once} stopped, {_saved(each):.0f} % of updates saved, {once_false} stops false "
        f"(95 % interval {low:.0f} to {high:.0f} %); of {len(rows)} replays {stops} stopped, {_saved(rows):.0f} % "
        f"saved, {false} false"
    )


def _saved(rows: Sequence[Record]) -> float:
    return float(np.mean([row["saved_percent"] for row in rows]))


def main() -> None:
    """Read the folders named on the command line, whole runs only; rows to standard output, summaries beside."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--episodes", type=int, default=20, help="of each evaluation that the rule sees")
    asked = parser.parse_args()
    runs = {path.name: read_run(path) for path in asked.folder}
    whole = {name: run for name, run in runs.items() if len(run.history) == run.config.search.updates}
    rules: dict[str, Rule] = {"flat": lambda records: flat(records) is not None}
    rules |= {f"patience {p}": lambda records, p=p: stalled(records, p) for p in (10, 20)}
    rows = {
        label: [row for run in whole.items() for row in replays(*run, rule, asked.episodes)]
        for label, rule in rules.items()
    }
    out = csv.DictWriter(sys.stdout, fieldnames=["rule", *rows["flat"][0]])
    out.writeheader()
    for label, judgements in rows.items():
        out.writerows({"rule": label, **row} for row in judgements)
        print(summary(label, judgements), file=sys.stderr)


if __name__ == "__main__":
    main()
