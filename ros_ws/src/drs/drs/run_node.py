"""How every node starts and ends: Ctrl-C and SIGTERM give status 0, a user's mistake one sentence."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from drs_core.errors import DrsError

SWITCH_INTERVAL_S = 1e-4
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
"""Which machines find each other. ROS's own default is the whole network, where anybody could command an arm."""


def run_node(make: Callable[[], Node], executor: Callable[[], Executor] = SingleThreadedExecutor) -> None:
    """Make a node, spin it until it is told to end, and clean up; ends the process.

    It is found on this machine only, unless the environment says otherwise.
    """
    status, node = 0, None
    # KeyboardInterrupt can fall between the taking of a lock and its `with`: then the executor's threads wait
    # for that lock for ever, and the process for them. rclpy's own handlers end the spinning
    interrupts: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    # rclpy's multi-threaded executor spins while a callback waits for its thread; at the interpreter's
    # usual 5 ms between threads that delays every callback by tens of milliseconds on a quiet machine
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    os.environ.setdefault(DISCOVERY, "LOCALHOST")
    try:
        rclpy.init()
        node = make()
        # one may have come meanwhile, even before rclpy had its handlers
        if rclpy.ok() and not interrupts:
            spinner = executor()
            spinner.add_node(node)
            spinner.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (DrsError, InvalidParameterTypeException, InvalidParameterValueException) as error:
        print(f"drs: {error}", file=sys.stderr)
        status = getattr(error, "exit_status", 2)
    except Exception:
        # a signal shuts the context down at any moment, also under a callback that publishes
        if rclpy.ok():
            raise
    finally:
        status = status or getattr(node, "exit_status", 0)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    sys.exit(status)
