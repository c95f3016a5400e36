"""Transitions that a lifecycle node's state does not have: answered with success=false and a sentence in the log."""

from __future__ import annotations

from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rclpy.lifecycle import LifecycleNode

from drs_core.errors import shown


def refuse_wrong_transitions(node: LifecycleNode) -> None:
    """Look at each request of change_state before rclpy does, whose own callback raises and so ends the node."""
    offered = {service.srv_name.rsplit("/", 1)[-1]: service for service in node.services}
    carry_out = offered["change_state"].callback

    def transitions(service: str) -> list[Transition]:
        request, response = GetAvailableTransitions.Request(), GetAvailableTransitions.Response()
        return [t.transition for t in offered[service].callback(request, response).available_transitions]

    def answer(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        asked, allowed = request.transition, transitions("get_available_transitions")
        # the label counts where there is one
        if asked.label in [t.label for t in allowed] or (not asked.label and asked.id in [t.id for t in allowed]):
            return carry_out(request, response)
        state = offered["get_state"].callback(GetState.Request(), GetState.Response()).current_state.label
        labels = {t.id: t.label for t in transitions("get_transition_graph")}
        what = shown(asked.label) if asked.label else f"{asked.id} ({labels.get(asked.id, 'unknown')})"
        rest = f"allowed are {', '.join(f'{t.label} ({t.id})' for t in allowed)}" if allowed else "none is"
        node.get_logger().warning(f"change_state: the transition {what} is not allowed in the state {state}; {rest}.")
        response.success = False
        return response

    offered["change_state"].callback = answer
