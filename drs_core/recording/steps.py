"""Observations of a recording and the actions that answered them, paired."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import DrsError, UsageError, install
from drs_core.recording.definitions import ACTION_TYPE, KNOWN, OBSERVATION_TYPE, normalised
from drs_core.recording.reader import Recorded, RecordingReader, contents

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Key = tuple[int, int, int]
"""Moment (s, ns) and number of an observation: a simulator that begins anew counts from 1 again."""

MAX_WAITING = 10_000
"""Observations without an action, or the other way round, that are remembered."""


@dataclass(frozen=True, eq=False)
class Seen:
    """An observation of a recording.

    Attributes:
        received_ns: when it came, since 1970.
        environment: gymnasium id.
        step: steps taken before it in its episode.
        parts: by key, each (size,) float64.
    """

    received_ns: int
    environment: str
    step: int
    parts: dict[str, Float64]


class AnsweredSteps:
    """Every observation with its action, in the order in which they were complete.

    Attributes:
        topic: of the observations.
        unanswered: observations without an action, but for the last of an episode; known after the last pair.
        complete: whether the recording has its end; likewise.
    """

    def __init__(self, path: Path, topic: str | None = None) -> None:
        """Find the topic: the one given, or the only one with actions beside it.

        Raises:
            UsageError: the recording is damaged, or has none or several.
        """
        self.path, self.topic = path, _topic(path, topic)
        self.unanswered, self.complete = 0, False

    def __iter__(self) -> Iterator[tuple[Seen, Float32]]:
        """Observations and actions (n_actions,) float32.

        Raises:
            UsageError: a message of the two topics is not usable.
        """
        reader, waiting, early = RecordingReader(self.path), dict[Key, Seen](), dict[Key, Float32]()
        self.unanswered = 0
        for message in reader.messages():
            if message.topic.name == self.topic and message.topic.kind == OBSERVATION_TYPE:
                found = self._observation(message)
                if found is None:
                    continue
                key, waiting[found[0]] = found
            elif message.topic.name == _beside(self.topic) and message.topic.kind == ACTION_TYPE:
                decoded = self._decoded(message)
                key = _key(decoded, decoded.observation)
                early[key] = np.array(decoded.values, dtype=np.float32)
            else:
                continue
            if key in waiting and key in early:
                yield waiting.pop(key), early.pop(key)
            self.unanswered += _forget(waiting)
            _forget(early)
        self.unanswered += len(waiting)
        self.complete = reader.complete

    def _observation(self, message: Recorded) -> tuple[Key, Seen] | None:
        decoded = self._decoded(message)
        if decoded.terminated or decoded.truncated:
            return None
        sizes, values = [int(size) for size in decoded.sizes], np.array(decoded.values, dtype=np.float64)
        if len(sizes) != len(decoded.keys) or sum(sizes) != len(values) or not np.isfinite(values).all():
            raise UsageError(f"{self.path} has an observation whose sizes do not fit, or that is not finite.")
        parts = dict(zip(decoded.keys, np.split(values, np.cumsum(sizes)[:-1])))
        return _key(decoded, decoded.number), Seen(message.received_ns, decoded.environment, int(decoded.step), parts)

    def _decoded(self, message: Recorded) -> Any:
        kind = message.topic.kind
        if not _is_known(kind, message.topic.definition):
            raise UsageError(f"{self.path} defines {kind} in another way than this version; record it anew.")
        try:
            return _decoder(kind)(message.data)
        except DrsError:
            raise
        except Exception as error:
            # the library raises many kinds of errors for bytes that make no sense
            raise UsageError(f"{self.path} has a message on {message.topic.name} that cannot be read.") from error


def _topic(path: Path, wanted: str | None) -> str:
    kinds = {topic.name: topic.kind for topic in contents(path).counts}
    found = [name for name, kind in kinds.items() if kind == OBSERVATION_TYPE]
    if wanted is None:
        answered = [name for name in found if kinds.get(_beside(name)) == ACTION_TYPE]
        if len(answered) == 1:
            return answered[0]
        raise UsageError(
            f"{path} has observations on {', '.join(found) or 'no topic'}, with actions beside them on "
            f"{', '.join(answered) or 'none'}; " + ("name one with --topic." if answered else "record both.")
        )
    if wanted not in found:
        raise UsageError(f"{path} has no observations on {wanted[:80]}; it has them on {', '.join(found) or 'none'}.")
    return wanted


def _beside(topic: str) -> str:
    """Where the answers to observations on a topic are."""
    return f"{topic.removesuffix('observation')}action"


def _forget(waiting: dict[Key, Any]) -> int:
    """Let go of what has waited longest, where much does; how many."""
    many = max(len(waiting) - MAX_WAITING, 0)
    for key in list(waiting)[:many]:
        del waiting[key]
    return many


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
