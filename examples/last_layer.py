"""The paper's ablation: how many updates do all parameters, or the last layer alone, need to reach a return?

python last_layer.py [updates, at most] [agent] [return to reach] [backend] [seeds]; runs are kept, and resumed.
"""

import sys
from contextlib import closing, suppress
from itertools import product
from pathlib import Path

from drs_core import json_lines
from drs_core.importing import resolve
from drs_core.rollouts import local
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Observer, Record, Tuning


class UntilReached(Observer):
    """Ends a run at the first evaluation that reaches the return."""

    def on_evaluation(self, record: Record) -> None:
        """Evaluations come after every update."""
        if record["return_mean"] >= goal:
            raise StopIteration


if __name__ == "__main__":
    defaults = ["2", "panda_reach", "-1.6", "python", "1"]
    limit, name, goal, backend, seeds = [*sys.argv[1:], *defaults[len(sys.argv) - 1 :]]
    limit, goal, seeds, start = int(limit), float(goal), int(seeds), resolve(name)
    print("run,seed,updates,return_mean,reached")
    for seed, last_layer in product(range(seeds), (False, True)):
        config = TuneConfig(SearchConfig(seed=seed, last_layer=last_layer), evaluate_every=1, backend=backend)
        path = Path(f"{start.environment}-{'last-layer' if last_layer else 'all'}-{seed}")
        with closing(local(start, workers=2, backend=backend)) as rollouts, suppress(StopIteration):
            Tuning(start, name, config, path, resume=True).run(rollouts, UntilReached(), stop_after=limit)
        last = json_lines.read(path / "evaluations.jsonl")[-1]
        print(f"{path},{seed},{last['update']},{last['return_mean']:.2f},{last['return_mean'] >= goal}", flush=True)
