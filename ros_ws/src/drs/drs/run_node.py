"""How every node starts and ends: Ctrl-C and SIGTERM give status 0, a user's mistake one sentence."""

from __future__ import annotations

import sys
from collections.abc import Callable

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from drs_core.errors import DrsError


def run_node(make: Callable[[], Node], executor: Callable[[], Executor] = SingleThreadedExecutor) -> None:
    """Make a node, spin it until it is told to end, and clean up; ends the process."""
    status, node = 0, None
    try:
        rclpy.init()
        node = make()
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
        try:
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
        except KeyboardInterrupt:
            pass
    sys.exit(status)
