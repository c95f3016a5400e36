"""The whole job in Python: a shipped agent in, a tuned one out, compared on the same seeds.

Run it in a folder of your own: python tune_in_python.py [updates]
"""

import sys
from contextlib import closing
from pathlib import Path

from rich.console import Console

from drs_core.evaluation import comparison, evaluate
from drs_core.importing import resolve
from drs_core.objective import Objective
from drs_core.reporting.progress import TuningProgress
from drs_core.reporting.tables import comparison_table
from drs_core.rollouts import local
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Tuning

# workers are new processes, which import this file: everything that acts stands below this line
if __name__ == "__main__":
    updates = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    start = resolve("panda_reach")
    config = TuneConfig(SearchConfig(updates=updates, directions=16), Objective("smooth"), evaluate_every=0)
    console = Console()
    with closing(local(start, workers=2)) as rollouts:
        with TuningProgress(console, updates) as progress:
            tuned = Tuning(start, "panda_reach", config, Path("run"), resume=True).run(rollouts, progress)
        pair = [evaluate(name, agent, rollouts, 20, 0) for name, agent in (("before", start), ("after", tuned))]
    console.print(comparison_table(comparison(*pair)))
