"""How every node starts and ends: Ctrl-C and SIGTERM give status 0, a user's mistake one sentence."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from drs_core.errors import DrsError

SWITCH_INTERVAL_S = 1e-4
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
"""Which machines find each other. ROS's own default is the whole network, where anybody could command an arm."""


def _spin(executor: Executor, node: Node) -> None:
    """Spin, and pass over what ROS itself cannot take: a wild set_parameters or /clock raises inside rclpy."""
    while rclpy.ok():
        try:
            executor.spin()
        except (TypeError, ValueError) as error:
            if not rclpy.ok() or _is_ours(error):
                raise
            node.get_logger().warning(f"A message that ROS cannot take is passed over: {error}")
        else:
            return


def _is_ours(error: Exception) -> bool:
    """Whether any code of drs that a callback called was on the way to an error."""
    modules = (frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__))
    return any(name.partition(".")[0] in ("drs", "drs_core") for name in modules if name != __name__)


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
            _spin(spinner, node)
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
