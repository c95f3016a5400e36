"""A learner's whole state, to the training folder and back."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from drs_core.errors import UsageError
from drs_core.training import replay, state
from drs_core.training.folder import Generation, TrainingFolder, array_bytes
from drs_core.training.model import Learner


class Checkpoints:
    """Writes states of one learner, each replay row once, and restores the newest that is whole."""

    def __init__(self, folder: TrainingFolder, learner: Learner) -> None:
        """Nothing is written yet."""
        self._folder = folder
        self._learner = learner
        self._buffer: Any = getattr(learner.model, "replay_buffer", None)
        self._segments: list[replay.Segment] = []
        self._kept_end = 0
        self._left_out = 0

    def save(self, progress: dict[str, Any]) -> None:
        """Write a generation with `progress` beside the learner's state.

        Raises:
            DrsError: the folder cannot be written; the generations before are whole.
        """
        folder, learner = self._folder, self._learner
        kept: list[str] = []
        if self._buffer is not None:
            self._segments = self._add_rows()
            kept = [segment.file for segment in self._segments if folder.newest and segment.file in folder.newest.files]
        content = {
            "progress": progress,
            "numbers": state.numbers(learner),
            "tensors": folder.add("model.pt", state.tensors(learner)),
            "arrays": folder.add("state.npz", array_bytes(state.arrays(learner))),
            "replay": [asdict(segment) for segment in self._segments],
            "replay_end": self._kept_end,
        }
        folder.commit(content, kept)

    def restore(self, generation: Generation) -> dict[str, Any]:
        """Make the learner what it was; returns the progress kept with it.

        Raises:
            UsageError: the generation is not of such a learner.
        """
        folder, content, learner = self._folder, generation.content, self._learner
        try:
            state.restore(
                learner, content["numbers"], folder.read_arrays(content["arrays"]), folder.read(content["tensors"])
            )
            self._segments = [replay.Segment(**segment) for segment in content["replay"]]
            self._kept_end = int(content["replay_end"])
            progress: dict[str, Any] = content["progress"]
        except (KeyError, TypeError) as error:
            raise UsageError(f"{folder.path} was written by another version: {error} is not as expected.") from error
        if self._buffer is not None:
            replay.restore(self._buffer, self._segments, self._kept_end, folder.read_arrays)
            self._left_out = learner.model.num_timesteps - self._kept_end
        folder.newest = generation
        return progress

    def _add_rows(self) -> list[replay.Segment]:
        # one environment: every step adds one row
        end = replay.usable_rows(self._buffer, self._learner.model.num_timesteps - self._left_out)
        segments = list(self._segments)
        if end > self._kept_end:
            first, rows = replay.new_rows(self._buffer, self._kept_end, end)
            name = self._folder.add("replay.npz", array_bytes(rows))
            segments.append(replay.Segment(name, first, end - first))
        self._kept_end = end
        return replay.still_needed(segments, self._buffer, end)
