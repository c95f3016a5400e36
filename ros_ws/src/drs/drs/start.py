"""Where the process of each node begins: Ctrl-C while Python imports the rest ends it too, with status 0."""

from __future__ import annotations

import importlib
import os
import signal
from functools import partial


def _start(module: str) -> None:
    # nothing is there yet that would have to be cleaned up; `run_node` handles what comes later
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(0))
    importlib.import_module(f"drs.{module}").main()


simulator_node = partial(_start, "simulator_node")
tuner_node = partial(_start, "tuner_node")
policy_node = partial(_start, "policy_node")
mock_arm_node = partial(_start, "mock_arm_node")
recorder_node = partial(_start, "recorder_node")
