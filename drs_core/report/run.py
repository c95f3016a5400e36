"""What a run folder says of its run, every type and range checked: the files may be from anywhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drs_core import json_lines
from drs_core.errors import UsageError, shown
from drs_core.files import parse_json, read_bounded
from drs_core.parameters import TUNER
from drs_core.run_folder import FORMAT, MAX_RUN_JSON_BYTES, RunFolder
from drs_core.tune_config import TuneConfig, tune_config
from drs_core.versions import Part, Versions, known

Record = dict[str, Any]

_CURVE = ("objective_mean", "objective_std", "return_mean", "return_std")


@dataclass(frozen=True)
class Run:
    """One run, as it stands in its folder.

    Attributes:
        folder: its files.
        name, environment, digest: of the agent that it began with.
        config: everything that decides its result.
        weight: c of ``smooth``, given or from the baseline; None where it is unused or not yet measured.
        versions: of the packages that it began with.
        made_with: those and the ones that it went on with, each from its first update on.
        history: a record an update.
        evaluations: a record an evaluation during the run.
    """

    folder: RunFolder
    name: str
    environment: str
    digest: str
    config: TuneConfig
    weight: float | None
    versions: Versions
    made_with: list[Part]
    history: list[Record]
    evaluations: list[Record]


def read_run(path: Path) -> Run:
    """Read the folder of a run; it may be at work meanwhile.

    Raises:
        UsageError: there is none, or a file of it is damaged.
    """
    folder = RunFolder(path)
    if not folder.exists():
        raise UsageError(f"{path} holds no run: there is no run.json. Give the folder of a drs tune --output.")
    stored = parse_json(read_bounded(folder.run_json, MAX_RUN_JSON_BYTES), str(folder.run_json))
    if not isinstance(stored, dict) or stored.get("format") != FORMAT:
        raise UsageError(f"{folder.run_json} is not of a run that this version knows.")
    config = _config(folder, _mapping(folder, stored, "config"))
    agent, versions = _mapping(folder, stored, "agent"), known(_mapping(folder, stored, "versions"))
    name, environment, digest = (_text(folder, agent, key) for key in ("name", "environment", "digest"))
    return Run(
        folder=folder,
        name=name,
        environment=environment,
        digest=digest,
        config=config,
        weight=folder.baseline_weight() if config.objective.needs_baseline else config.objective.smoothness_weight,
        versions=versions,
        made_with=folder.made_with(),
        history=_records(folder.history, (*_CURVE, "alpha", "sigma", "step_norm", "wall_s")),
        evaluations=_records(folder.evaluations, _CURVE),
    )


def _mapping(folder: RunFolder, stored: Record, key: str) -> Record:
    value = stored.get(key)
    if not isinstance(value, dict):
        raise UsageError(f"{folder.run_json}: {key} is {shown(value)}, not a mapping.")
    return value


def _text(folder: RunFolder, stored: Record, key: str) -> str:
    value = stored.get(key)
    if not isinstance(value, str):
        raise UsageError(f"{folder.run_json}: the agent's {key} is {shown(value)}, not a text.")
    return value


def _config(folder: RunFolder, stored: Record) -> TuneConfig:
    values = {}
    for key, value in stored.items():
        if key not in TUNER:
            raise UsageError(f"{folder.run_json}: the setting {shown(key)} is unknown; is it of a newer version?")
        if value is None:
            continue
        try:
            values[key] = TUNER[key](value)
        except ValueError as error:
            raise UsageError(f"{folder.run_json}: {key} is {shown(value)}, but must be {error}.") from error
    try:
        return tune_config(values)
    except UsageError as error:
        raise UsageError(f"{folder.run_json}: {error}") from error


def _records(path: Path, needed: Iterable[str]) -> list[Record]:
    records = json_lines.read(path)
    for record in records:
        for key in needed:
            value = record.get(key)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e300:
                raise UsageError(f"{path}: {key} of update {record['update']} is {shown(value)}, not a number.")
    return records
