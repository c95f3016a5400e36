"""What a training keeps on disk, so that it can be killed at any moment and resumed.

A generation is a file of numbers, ``state/00007.json``, that names the other files of the state with
their sha256; it is written last. The two newest generations are kept: where a file of the newest is
damaged, the training goes on from the one before.
"""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core import json_lines
from drs_core.agent import Agent, load
from drs_core.errors import UsageError, shown
from drs_core.files import make_folder, parse_json, read_bounded, write_atomically
from drs_core.versions import installed

FORMAT = 1
MAX_JSON_BYTES = 2**22
MAX_STATE_FILE_BYTES = 2**34
# of settings that trainings begun by an earlier version do not name
_BEFORE = {"teacher": False, "teach_every": 0, "imitate": 0}


@dataclass
class Generation:
    """One state on disk.

    Attributes:
        number: counts up.
        content: numbers and names, as JSON has them.
        files: name -> sha256 of every other file that it consists of.
    """

    number: int
    content: dict[str, Any]
    files: dict[str, str]


class TrainingFolder:
    """Files of one training: training.json, evaluations.jsonl, agent and best .safetensors, state/."""

    def __init__(self, path: Path) -> None:
        """Name the files; nothing is touched yet."""
        self.path = path
        self.training_json = path / "training.json"
        self.evaluations = path / "evaluations.jsonl"
        self.agent = path / "agent.safetensors"
        self.best = path / "best.safetensors"
        self.state = path / "state"
        self.newest: Generation | None = None
        self._pending: dict[str, str] = {}

    def check_free(self) -> None:
        """Raise UsageError where the folder holds something already."""
        if self.training_json.exists():
            raise UsageError(
                f"{self.path} holds a training already; continue it with --resume, or choose another folder with --run."
            )
        if self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
            raise UsageError(f"{self.path} holds something else; choose a new folder with --run.")

    def begin(self, record: dict[str, Any]) -> None:
        """Begin a training.

        Raises:
            UsageError: the folder holds something already; nothing of it is touched.
            DrsError: it cannot be made or written.
        """
        self.check_free()
        make_folder(self.path)
        content = {"format": FORMAT, "settings": record, "versions": installed("torch", "stable-baselines3")}
        write_atomically(self.training_json, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())

    def check(self, record: dict[str, Any], free: tuple[str, ...]) -> None:
        """Raise UsageError unless this training was begun with the same settings, but for the free ones."""
        stored = parse_json(read_bounded(self.training_json, MAX_JSON_BYTES), str(self.training_json))
        begun = stored.get("settings") if isinstance(stored, dict) else None
        if not isinstance(begun, dict) or stored.get("format") != FORMAT:
            raise UsageError(f"{self.training_json} is not of a training that this version can continue.")
        for key, value in json.loads(json.dumps(record)).items():
            before = begun.get(key, _BEFORE.get(key))
            if key not in free and before != value:
                raise UsageError(
                    f"{self.path} was begun with {key} = {shown(before)}, not {shown(value)}: "
                    "give the same, or a new folder with --run."
                )

    def add(self, name: str, content: bytes) -> str:
        """Write one file of the coming generation; returns its name."""
        number = self._next()
        file = f"{number:05d}-{name}"
        self.state.mkdir(exist_ok=True)
        write_atomically(self.state / file, content)
        self._pending[file] = hashlib.sha256(content).hexdigest()
        return file

    def commit(self, content: dict[str, Any], kept: list[str]) -> None:
        """Make what was added the newest generation, with `kept` files of earlier ones; drop all older than two."""
        before = self.newest
        known = before.files if before is not None else {}
        files = {name: known[name] for name in kept} | self._pending
        generation = Generation(self._next(), content, files)
        body = {"format": FORMAT, "content": content, "files": files}
        text = json.dumps(body | {"check": _check_sum(body)}, allow_nan=False)
        write_atomically(self.state / f"{generation.number:05d}.json", text.encode())
        self.newest, self._pending = generation, {}
        wanted = {name for one in (before, generation) if one is not None for name in (*one.files, _json_name(one))}
        for file in self.state.iterdir():
            if file.name not in wanted:
                file.unlink(missing_ok=True)

    def generations(self) -> list[int]:
        """Numbers of what was kept, newest first."""
        if not self.state.is_dir():
            return []
        return sorted((int(file.stem) for file in self.state.glob("*.json") if file.stem.isdigit()), reverse=True)

    def open(self, number: int) -> Generation:
        """A generation of which every file is whole.

        Raises:
            UsageError: a file is missing or damaged.
        """
        path = self.state / f"{number:05d}.json"
        body = parse_json(read_bounded(path, MAX_JSON_BYTES), str(path))
        check = body.pop("check", None) if isinstance(body, dict) else None
        if check is None or check != _check_sum(body) or body.get("format") != FORMAT:
            raise UsageError(f"{path} is damaged.")
        for name, sha256 in body["files"].items():
            if hashlib.sha256(self.read(name)).hexdigest() != sha256:
                raise UsageError(f"{self.state / name} is damaged.")
        return Generation(number, body["content"], body["files"])

    def read(self, name: str) -> bytes:
        """One file of a generation."""
        return read_bounded(self.state / name, MAX_STATE_FILE_BYTES)

    def read_arrays(self, name: str) -> dict[str, NDArray[Any]]:
        """One file of arrays of a generation.

        Raises:
            UsageError: it is no such file.
        """
        try:
            with np.load(io.BytesIO(self.read(name)), allow_pickle=False) as found:
                return {key: found[key] for key in found.files}
        except (ValueError, OSError, EOFError) as error:
            raise UsageError(f"{self.state / name} holds no arrays: {error}.") from error

    def record(self, evaluation: dict[str, Any]) -> None:
        """Add a line to the evaluations."""
        json_lines.append(self.evaluations, evaluation)

    def cut_back(self, steps: int) -> None:
        """Leave out the evaluations of steps that will be done again."""
        json_lines.cut_back(self.evaluations, steps, "steps")

    def best_agent(self) -> Agent | None:
        """The best so far; None before the first whole evaluation."""
        return load(self.best) if self.best.exists() else None

    def _next(self) -> int:
        # never a number used before, also where the newest generation was damaged
        newest = self.newest.number if self.newest is not None else 0
        return max([newest, *self.generations()]) + 1


def array_bytes(arrays: dict[str, NDArray[Any]]) -> bytes:
    """Arrays as one npz file."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def _json_name(generation: Generation) -> str:
    return f"{generation.number:05d}.json"


def _check_sum(body: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()
