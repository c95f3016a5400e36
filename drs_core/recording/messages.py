"""Observations and actions of a recording: decoded, and refused where an agent could not have had them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.actor import Actor
from drs_core.errors import DrsError, UsageError, install, shown
from drs_core.recording.definitions import KNOWN, normalised
from drs_core.recording.reader import Recorded

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Key = tuple[int, int, int]
"""Moment (s, ns) and number of an observation: a simulator that begins anew counts from 1 again."""

BESIDE_BYTES = 2**16
"""What a message may hold beside its numbers: its header, and names and sizes of parts."""


@dataclass(frozen=True, eq=False)
class Seen:
    """An observation of a recording.

    Attributes:
        received_ns: when it came, since 1970.
        step: steps taken before it in its episode.
        parts: by key, each (size,) float64.
    """

    received_ns: int
    step: int
    parts: dict[str, Float64]


class Messages:
    """What the messages of one file say to one agent, which decides their sizes; the file does not.

    Attributes:
        numbers: in an observation.
    """

    def __init__(self, path: Path, actor: Actor) -> None:
        """Name the file and the agent."""
        self._path, self._agent, self._sizes = path, actor.agent, actor.sizes
        self.numbers = sum(self._sizes.values())

    def observation(self, message: Recorded) -> tuple[Key, Seen] | None:
        """An observation that waits for an action; None: the last of an episode.

        Raises:
            UsageError: it is of another environment, too large, damaged or not finite.
        """
        decoded = self._decoded(message, 8 * self.numbers)
        if decoded.terminated or decoded.truncated:
            return None
        if decoded.environment != self._agent.environment:
            raise UsageError(
                f"{self._path} is of {shown(decoded.environment)}, the agent of {self._agent.environment}."
            )
        sizes, values = [int(size) for size in decoded.sizes], np.array(decoded.values, dtype=np.float64)
        # a policy sees float32, so that what is beyond is infinite for it
        if not (np.abs(values) <= np.finfo(np.float32).max).all():
            raise UsageError(f"{self._path} has an observation that is not finite, or beyond float32.")
        if len(sizes) != len(decoded.keys) or sum(sizes) != len(values):
            raise UsageError(f"{self._path} has an observation whose sizes do not fit.")
        found = list(zip(decoded.keys, sizes))
        if sorted(found) != sorted(self._sizes.items()):
            raise UsageError(f"{self._path} has observations of {shown(found)}, the agent of {shown(self._sizes)}.")
        parts = dict(zip(decoded.keys, np.split(values, np.cumsum(sizes)[:-1])))
        return _key(decoded, decoded.number), Seen(message.received_ns, int(decoded.step), parts)

    def action(self, message: Recorded) -> tuple[Key, Float32]:
        """An action (n_actions,) and which observation it answers.

        Raises:
            UsageError: it has another size, is damaged or not finite.
        """
        size = len(self._agent.low)
        decoded = self._decoded(message, 4 * size)
        values = np.array(decoded.values, dtype=np.float32)
        if len(values) != size:
            raise UsageError(f"{self._path} has actions of {len(values)} numbers, the agent of {size}.")
        if not np.isfinite(values).all():
            raise UsageError(f"{self._path} has an action that is not finite.")
        return _key(decoded, decoded.observation), values

    def _decoded(self, message: Recorded, numbers_bytes: int) -> Any:
        kind, size = message.topic.kind, len(message.data)
        if size > numbers_bytes + BESIDE_BYTES:
            raise UsageError(
                f"{self._path} has a message of {size} bytes on {shown(message.topic.name)}; those of "
                f"{self._agent.environment} have {numbers_bytes} and at most {BESIDE_BYTES} more."
            )
        if not _is_known(kind, message.topic.definition):
            raise UsageError(f"{self._path} defines {kind} in another way than this version; record it anew.")
        try:
            return _decoder(kind)(message.data)
        except DrsError:
            raise
        except Exception as error:
            # the library raises many kinds of errors for bytes that make no sense
            raise UsageError(f"{self._path} has a message on {message.topic.name} that cannot be read.") from error


def _key(decoded: Any, number: int) -> Key:
    return int(decoded.header.stamp.sec), int(decoded.header.stamp.nanosec), int(number)


@cache
def _is_known(kind: str, definition: str) -> bool:
    return normalised(definition) == normalised(KNOWN[kind])


@cache
def _decoder(kind: str) -> Any:
    try:
        from mcap.records import Schema
        from mcap_ros2.decoder import DecoderFactory
    except ModuleNotFoundError as error:
        raise DrsError(f"Replaying needs mcap-ros2-support; {install('record')}.") from error
    return DecoderFactory().decoder_for("cdr", Schema(1, KNOWN[kind].encode(), "ros2msg", kind))
