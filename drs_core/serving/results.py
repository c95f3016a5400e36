"""What a guard can find: an enum with a sentence each, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Effect(Enum):
    """What a finding does to an active node."""

    GO = "the command is used"
    SKIP = "the input is passed over, nothing else changes"
    HOLD = "the arm is brought to rest and stays there until inputs are good again"
    FAULT = "nothing more is published until the fault is reset"


class Result(Enum):
    """A finding, its effect and its sentence."""

    OK = Effect.GO, "Inputs are good."
    NOT_ACTIVE = Effect.SKIP, "The policy is not active."
    TOO_SOON = Effect.SKIP, "The last step is less than a period ago."
    DROPPED = Effect.SKIP, "The work began before a fault or a stop and is dropped."
    NO_INPUT = Effect.HOLD, "An input has not come yet."
    STALE = Effect.HOLD, "An input is too old."
    GOAL_OUTSIDE = Effect.HOLD, "The goal is outside the workspace."
    TIP_OUTSIDE = Effect.HOLD, "The tip is outside the workspace."
    NOT_AT_REST = Effect.HOLD, "The arm moves, and a start is from rest."
    JOINT_OUTSIDE = Effect.HOLD, "A joint is outside its limits."
    INTERRUPTED = Effect.HOLD, "Commands were interrupted, and the arm has to begin anew from rest."
    OUT_OF_REACH = Effect.HOLD, "The arm cannot reach the target."
    NOT_FINITE = Effect.FAULT, "An input is not finite."
    INCOMPLETE = Effect.FAULT, "An input is incomplete."
    WRONG_FRAME = Effect.FAULT, "An input is in another frame."
    CLOCK = Effect.FAULT, "The clock is wrong."
    MISMATCH = Effect.FAULT, "The tip pose and the joint states contradict each other."
    NOT_FOLLOWING = Effect.FAULT, "The arm does not follow its commands."
    BAD_ACTION = Effect.FAULT, "The policy's action is not usable."
    BAD_COMMAND = Effect.FAULT, "A command would have left the limits."
    OTHER_PUBLISHER = Effect.FAULT, "Somebody else publishes commands for this arm."

    def __init__(self, effect: Effect, sentence: str) -> None:
        """Give each member its effect and sentence."""
        self.effect, self.sentence = effect, sentence


@dataclass(frozen=True)
class Verdict:
    """A result and the values behind it."""

    result: Result
    detail: str = ""

    @property
    def sentence(self) -> str:
        """One or two sentences for a person."""
        return f"{self.result.sentence} {self.detail}".rstrip()


OK = Verdict(Result.OK)
