"""Observations of a recording and the actions that answered them, paired."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from drs_core.actor import Actor
from drs_core.errors import UsageError
from drs_core.recording.definitions import ACTION_TYPE, OBSERVATION_TYPE
from drs_core.recording.messages import Float32, Key, Messages, Seen
from drs_core.recording.reader import RecordingReader, contents

MAX_WAITING, MAX_WAITING_NUMBERS = 10_000, 2**23
"""Observations without an action, or the other way round, that are remembered, and numbers in them."""


class AnsweredSteps:
    """Every observation with its action, in the order in which they were complete.

    Attributes:
        topic: of the observations.
        unanswered: observations without an action, but for the last of an episode; known after the last pair.
        complete: whether the recording has its end; likewise.
    """

    def __init__(self, path: Path, actor: Actor, topic: str | None = None) -> None:
        """Find the topic: the one given, or the only one with actions beside it.

        Args:
            path: of the file.
            actor: whose observations and actions they have to be.
            topic: of the observations.

        Raises:
            UsageError: the recording is damaged, or has none or several.
        """
        self.path, self.topic, self._messages = path, _topic(path, topic), Messages(path, actor)
        self.unanswered, self.complete = 0, False

    def __iter__(self) -> Iterator[tuple[Seen, Float32]]:
        """Observations of the actor's sizes and actions (n_actions,) float32, all finite.

        Raises:
            UsageError: a message of the two topics is not usable, or of another environment.
        """
        reader, waiting, early = RecordingReader(self.path), dict[Key, Seen](), dict[Key, Float32]()
        most = max(1, min(MAX_WAITING, MAX_WAITING_NUMBERS // max(1, self._messages.numbers)))
        self.unanswered = 0
        for message in reader.messages():
            if message.topic.name == self.topic and message.topic.kind == OBSERVATION_TYPE:
                found = self._messages.observation(message)
                if found is None:
                    continue
                key, waiting[found[0]] = found
            elif message.topic.name == _beside(self.topic) and message.topic.kind == ACTION_TYPE:
                answer = self._messages.action(message)
                key, early[answer[0]] = answer
            else:
                continue
            if key in waiting and key in early:
                yield waiting.pop(key), early.pop(key)
            self.unanswered += _forget(waiting, most)
            _forget(early, most)
        self.unanswered += len(waiting)
        self.complete = reader.complete


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


def _forget(waiting: dict[Key, Any], most: int) -> int:
    """Let go of what has waited longest, where more does than that; how many."""
    many = max(len(waiting) - most, 0)
    for key in list(islice(waiting, many)):
        del waiting[key]
    return many
