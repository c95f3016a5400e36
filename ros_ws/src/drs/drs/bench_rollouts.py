"""The ROS 2 side of ``drs bench``: rollouts over simulator nodes of its own, one line of JSON for another.

`bench_rollouts AGENT_FILE NODES` says ``{"ready": NODES}`` and then answers each line
``{"seed": s, "steps": n}`` with what those steps cost; it ends with its standard input.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from rclpy.executors import MultiThreadedExecutor

from drs.fleet import Fleet
from drs.patience import Patience
from drs.run_node import SWITCH_INTERVAL_S
from drs.service_rollouts import ServiceRollouts
from drs.turns import Turns
from drs_core.agent import Agent, load
from drs_core.bench.processes import together
from drs_core.bench.variants.ours import Together
from drs_core.errors import DrsError

_PATIENCE_S = 30.0
_LOOK_S = 0.1


@contextmanager
def simulators(count: int) -> Iterator[list[int]]:
    """Simulator nodes without topics, in this process's domain; yields their process ids."""
    executable = Path(get_package_prefix("drs")) / "lib" / "drs" / "simulator_node"
    started = []
    try:
        for number in range(count):
            command = [executable, "--ros-args", "-r", f"__node:=bench_simulator_{number}", "-p", "stream:=false"]
            # in a session of their own: Ctrl-C reaches this process, which ends them
            started.append(subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=2, start_new_session=True))
        yield [process.pid for process in started]
    finally:
        for process in started:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        for process in started:
            process.wait()


@contextmanager
def fleet() -> Iterator[Fleet]:
    """The simulators of this process's domain, looked after by a thread."""
    rclpy.init()
    node = rclpy.create_node("bench_rollouts")
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        yield Fleet(node)
    finally:
        rclpy.try_shutdown()
        thread.join()


def wait_for(found: Fleet, count: int) -> None:
    """Until `count` simulators are there."""
    end = time.monotonic() + _PATIENCE_S
    while len(found.refresh()) < count:
        if time.monotonic() > end:
            raise DrsError(f"{count} simulator nodes were started, but {len(found.refresh())} answer.")
        time.sleep(_LOOK_S)


def serve(agent: Agent, count: int) -> None:
    """Answer lines until there are no more."""
    with simulators(count) as pids, fleet() as found:
        wait_for(found, count)
        patience = Patience(no_simulator_s=_PATIENCE_S)
        say = partial(print, file=sys.stderr)
        rollouts = ServiceRollouts(found, Turns(), agent, patience, lambda: False, say)
        variant = Together(agent, rollouts, count, partial(together, pids))
        print(json.dumps({"ready": count}), flush=True)
        for line in sys.stdin:
            print(json.dumps(asdict(variant.run(**json.loads(line)))), flush=True)


def main() -> None:
    """Run until standard input ends; status 1 and a sentence where that is not possible."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        serve(load(Path(sys.argv[1])), int(sys.argv[2]))
    except DrsError as error:
        sys.exit(f"bench_rollouts: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
