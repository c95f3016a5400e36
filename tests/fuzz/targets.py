"""What is fuzzed: each target makes its valid files once, and tries one input at a time."""

from __future__ import annotations

import json
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from random import Random

from drs_core import json_lines
from drs_core.agent import Agent, load
from drs_core.importing import import_agent
from drs_core.importing.arrays import array
from drs_core.importing.normaliser import read_normaliser
from drs_core.importing.pickle_data import read_pickle
from drs_core.importing.zoo_config import read_yaml, wrapping
from drs_core.parameters import read_parameters
from drs_core.recording.reader import contents
from drs_core.recording.replay import replay, summary
from drs_core.report.repeat import parameter_file, portable
from drs_core.report.run import read_run
from drs_core.tuning import Tuning
from drs_core.versions import installed
from tests.conftest import make_agent
from tests.fuzz import seeds
from tests.fuzz.mutate import (
    ANY,
    chunks_changed,
    json_changed,
    lines_changed,
    mutated,
    safetensors_changed,
    zip_changed,
)


class Target(ABC):
    """One way in. `attempt` may raise DrsError and nothing else."""

    def __init__(self, folder: Path) -> None:
        """Make the valid files in a folder."""
        self.folder = folder

    @abstractmethod
    def attempt(self, rng: Random) -> None:
        """Make one input and try it; the same `rng` makes the same input."""

    @abstractmethod
    def valid(self) -> None:
        """Try what is valid: it must be taken, and imports whatever is imported late."""

    def close(self) -> None:  # noqa: B027
        """Free what is held, where something is."""


class AgentFile(Target):
    """``drs evaluate FILE``: an agent file."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._content, self._path = seeds.tuned_agent().to_bytes(), folder / "x.safetensors"

    def valid(self) -> None:
        self._try(self._content)

    def attempt(self, rng: Random) -> None:
        self._try(mutated(self._content, rng, (*ANY, *[safetensors_changed] * 8)))

    def _try(self, content: bytes) -> None:
        self._path.write_bytes(content)
        _used(load(self._path))


class Zoo(Target):
    """``drs import FOLDER``: one file of a zoo folder is another."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._zoo = seeds.zoo(folder / "zoo")
        self._contents = {path: path.read_bytes() for path in sorted(self._zoo.rglob("*")) if path.is_file()}

    def valid(self) -> None:
        _used(import_agent(str(self._zoo)))

    def attempt(self, rng: Random) -> None:
        path = rng.choice(list(self._contents))
        content = self._contents[path]
        if path.suffix == ".zip":
            inner = lambda old, rng: json_changed(old, rng) if old.startswith(b"{") else mutated(old, rng)  # noqa: E731
            content = zip_changed(content, rng, inner) if rng.random() < 0.8 else mutated(content, rng)
        else:
            content = mutated(content, rng)
        path.write_bytes(content)
        try:
            _used(import_agent(str(self._zoo)))
        finally:
            path.write_bytes(self._contents[path])


class Pickles(Target):
    """vecnormalize.pkl and the index of a state dict, without the files around them."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._normaliser = seeds.normaliser()

    def valid(self) -> None:
        read_normaliser(self._normaliser, "x")

    def attempt(self, rng: Random) -> None:
        content = mutated(self._normaliser, rng)
        if rng.random() < 0.7:
            read_normaliser(content, "x")
        else:
            array(read_pickle(content, "x", lambda _: True), "x")


class Yaml(Target):
    """A parameter file, and the zoo's configuration."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._path = folder / "x.yaml"
        self._texts = [seeds.PARAMETERS.encode(), seeds.ZOO["config.yml"].encode()]

    def valid(self) -> None:
        self._try(self._texts[0], self._parameters)
        self._path.write_bytes(self._texts[1])
        wrapping(read_yaml(self._path), {}, "x")

    def attempt(self, rng: Random) -> None:
        which = rng.randrange(2)
        self._try(mutated(self._texts[which], rng), self._zoo if which else self._parameters)

    def _parameters(self) -> None:
        read_parameters(self._path)

    def _zoo(self) -> None:
        config = read_yaml(self._path)
        wrapping(config, {}, "x")

    def _try(self, content: bytes, read: Callable[[], None]) -> None:
        self._path.write_bytes(content)
        read()


class Recording(Target):
    """``drs replay FILE``: an MCAP file."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._path, self._agent = folder / "x.mcap", make_agent(seeds.ENVIRONMENT)
        self._content = seeds.recording(folder / "valid.mcap").read_bytes()

    def valid(self) -> None:
        self._try(self._content)

    def attempt(self, rng: Random) -> None:
        self._try(mutated(self._content, rng, (*ANY, *[chunks_changed] * 6)))

    def _try(self, content: bytes) -> None:
        self._path.write_bytes(content)
        contents(self._path)
        summary(replay(self._path, self._agent))


class RunFolders(Target):
    """``drs report DIR`` and ``drs tune --resume`` with a folder that comes from elsewhere."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._path, self._start = folder / "run", make_agent(seeds.ENVIRONMENT)
        self._config = seeds.run(self._path)
        self._record = json_lines.read(self._path / "history.jsonl")[-1]
        names = ("run.json", "history.jsonl", "evaluations.jsonl", "agent.safetensors", "best.safetensors")
        self._contents = {self._path / name: (self._path / name).read_bytes() for name in names}
        self._outside = folder.parent / f"{folder.name}-outside"
        self._outside.mkdir()

    def valid(self) -> None:
        self._try()

    def close(self) -> None:
        shutil.rmtree(self._outside)

    def attempt(self, rng: Random) -> None:
        path, linked = rng.choice(list(self._contents)), None
        if rng.random() < 0.1:
            linked = self._path / rng.choice((".lock", "tensorboard", *(path.name for path in self._contents)))
            _away(linked)
            linked.symlink_to(self._outside / rng.choice(("x", "absent/x", "")))
        else:
            change = {".json": json_changed, ".jsonl": lines_changed}.get(path.suffix, safetensors_changed)
            path.write_bytes(mutated(self._contents[path], rng, (*ANY, *[change] * 12)))
        try:
            self._try()
        finally:
            if linked is not None:
                _away(linked)
            (self._path / "tensorboard").mkdir(exist_ok=True)
            for name, content in self._contents.items():
                _away(name)
                name.write_bytes(content)

    def _try(self) -> None:
        tuning = None
        try:
            tuning = Tuning(self._start, "agent", self._config, self._path, resume=True)
            # what the next update would do to the folder
            tuning._folder.goes_on_with(installed(), tuning.done)
            json_lines.append(self._path / "history.jsonl", self._record)
            self._start.save(self._path / "agent.safetensors")
            (self._path / "tensorboard" / "events").write_text("")
        finally:
            if tuning is not None:
                tuning._lock.close()
        run = read_run(self._path)
        _shown(portable(run.name), run.environment, run.versions, run.made_with, parameter_file(run))


def _away(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _used(agent: Agent) -> None:
    """What every use of an agent does first."""
    agent.policy()
    agent.assembler()
    agent.digest()
    agent.to_bytes()
    _shown(agent.environment, dict(agent.source), list(agent.tuning))


def _shown(*values: object) -> None:
    """What a page of a report does with texts, whoever wrote them."""
    json.dumps(values, ensure_ascii=False).encode()


TARGETS: dict[str, type[Target]] = {
    "agent": AgentFile,
    "zoo": Zoo,
    "pickle": Pickles,
    "yaml": Yaml,
    "recording": Recording,
    "run_folder": RunFolders,
}
