"""What serving is doing: one enum, a sentence each, and a pure function from one to the next."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class State(Enum):
    """A state and its sentence."""

    UNCONFIGURED = "No agent is loaded."
    INACTIVE = "Configured, and inactive until told."
    WAITING = "Active, and waiting for input."
    RUNNING = "Running: the arm follows the policy."
    HOLDING = "Holding: the arm is brought to rest and kept there until inputs are good again."
    FAULT = "Fault: nothing is published until it is reset."


class Event(Enum):
    """What can happen."""

    CONFIGURE = "an agent was loaded"
    ACTIVATE = "somebody said go"
    DEACTIVATE = "somebody said stop"
    CLEAN_UP = "the agent was put away"
    GOOD_INPUT = "every guard passed"
    DOUBT = "a guard found what may pass"
    FAULT = "a guard found what must not go on"
    RESET = "somebody said that the fault is mended"


ACTIVE = (State.WAITING, State.RUNNING, State.HOLDING)
MOVING = (State.RUNNING, State.HOLDING)
"""States in which commands are published."""

_NEXT = {
    (State.UNCONFIGURED, Event.CONFIGURE): State.INACTIVE,
    (State.INACTIVE, Event.ACTIVATE): State.WAITING,
    (State.INACTIVE, Event.CLEAN_UP): State.UNCONFIGURED,
    (State.WAITING, Event.GOOD_INPUT): State.RUNNING,
    (State.RUNNING, Event.DOUBT): State.HOLDING,
    (State.HOLDING, Event.GOOD_INPUT): State.RUNNING,
    # not to where it was: whoever resets a fault still has to say go
    (State.FAULT, Event.RESET): State.INACTIVE,
    **{(state, Event.DEACTIVATE): State.INACTIVE for state in ACTIVE},
    **{(state, Event.CLEAN_UP): State.UNCONFIGURED for state in ACTIVE},
    **{(state, Event.FAULT): State.FAULT for state in ACTIVE},
}


def next_state(state: State, event: Event) -> State:
    """The state after an event; an event that has no place in a state changes nothing."""
    return _NEXT.get((state, event), state)


@dataclass(frozen=True)
class Stand:
    """Where things stand.

    Attributes:
        state: one of the states.
        sentence: the state's, or what was found.
        epoch: goes up whenever commands may no longer be published; work that began in another
            epoch is dropped, however late it ends.
    """

    state: State = State.UNCONFIGURED
    sentence: str = State.UNCONFIGURED.value
    epoch: int = 0

    def after(self, event: Event, sentence: str = "") -> Stand:
        """Where things stand after an event.

        Args:
            event: what happened.
            sentence: what was found; without one, the new state's.
        """
        state = next_state(self.state, event)
        ended = self.state in ACTIVE and state not in ACTIVE
        if state is self.state and not (sentence and state in ACTIVE):
            return self
        return Stand(state, sentence or state.value, self.epoch + ended)
