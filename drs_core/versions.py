"""Which versions of packages made something, part by part, and where they are not those of today."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from drs_core import __version__

Versions = dict[str, str]
"""By package; empty where they are unknown."""

_PACKAGES = ("numpy", "gymnasium", "pybullet", "pybullet-envs-gymnasium", "panda-gym", "box2d")


class Part(NamedTuple):
    """What was made with one set of versions.

    Attributes:
        begin: how many updates or episodes were made before it.
        versions: of what made it.
    """

    begin: int
    versions: Versions


def installed(*also: str) -> Versions:
    """Versions of what decides a run's numbers, as far as it is installed, and of further packages."""
    found = {"drs": __version__, "python": platform.python_version()}
    for package in (*_PACKAGES, *also):
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def known(value: Any) -> Versions:
    """What a file says of versions, whatever it holds."""
    pairs = value.items() if isinstance(value, dict) else ()
    return {name: version for name, version in pairs if isinstance(version, str)}


def kept(parts: Iterable[Part], counter: str) -> list[dict[str, Any]]:
    """Parts as records of a file, their begin under the name `counter`."""
    return [{counter: part.begin, "versions": part.versions} for part in parts]


def read(records: Any, counter: str) -> list[Part] | None:
    """Such records as parts; None where they are none."""
    if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
        return None
    if not all(type(record.get(counter)) is int and record[counter] >= 0 for record in records):
        return None
    return [Part(record[counter], known(record.get("versions"))) for record in records]


def elsewhere(parts: Iterable[Part], now: Versions) -> dict[str, list[str]]:
    """The packages whose version in a part is not that of `now`, with their versions there, each once."""
    found: dict[str, list[str]] = {}
    for part in parts:
        for name, version in part.versions.items():
            if now.get(name) != version and version not in found.get(name, []):
                found.setdefault(name, []).append(version)
    return found


def extended(parts: Sequence[Part], begin: int, now: Versions) -> list[Part]:
    """Parts with a further one of `now` from `begin` on, where the newest is of other versions or of unknown ones."""
    goes_on = bool(parts) and bool(parts[-1].versions) and not elsewhere(parts[-1:], now)
    return [*parts] if goes_on else [*parts, Part(begin, now)]


def others(parts: Iterable[Part], now: Versions, there: str) -> list[str]:
    """``numpy 2.2.6 (before: 1.26.0)`` of every package that differs, with ``before`` as `there`."""
    return [
        f"{name} {now.get(name, 'not installed')} ({there}: {listed(versions)})"
        for name, versions in elsewhere(parts, now).items()
    ]


def listed(words: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join([*([", ".join(words[:-1])] if words[1:] else []), *words[-1:]])
