"""Service callbacks that may raise: a user's mistake becomes success=false and a sentence, nothing more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile

from drs_core.errors import DrsError

SERVICE_DEPTH = QoSProfile(depth=200)
"""Of both ends of every service: at the default depth of 10, requests that come together are lost."""

Call = Callable[[Any, Any], None]


def offer(node: Node, kind: type, name: str, call: Call, group: CallbackGroup) -> None:
    """Offer a service whose callback fills in the response, or raises DrsError."""

    def answer(request: Any, response: Any) -> Any:
        try:
            call(request, response)
            response.success = True
        except DrsError as error:
            response.success, response.message = False, str(error)
            node.get_logger().warning(f"{name}: {error}", throttle_duration_sec=1.0)
        except Exception as error:
            # a bug here must not end a node that others rely on; its traceback goes to the log
            import traceback

            node.get_logger().error(f"{name}: {traceback.format_exc()}")
            response.success = False
            response.message = f"{name} failed inside the node ({type(error).__name__}: {error}); see its log."
        return response

    node.create_service(kind, name, answer, qos_profile=SERVICE_DEPTH, callback_group=group)
