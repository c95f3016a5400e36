"""Which files make up an agent: a zip with its neighbours, or a folder of the zoo."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from drs_core.errors import UsageError

_NORMALISERS = ("vecnormalize.pkl", "vec_normalize.pkl")
_NOT_AGENTS = ("train_eval_metrics.zip", "best_model.zip")


@dataclass(frozen=True)
class Files:
    """The files of one saved agent; None where there is none."""

    zip: Path
    normaliser: Path | None
    config: Path | None
    arguments: Path | None
    env_kwargs: Path | None


def locate(source: Path) -> Files:
    """Find the files that belong to a zip or lie in a folder.

    Raises:
        UsageError: there is no agent, or more than one.
    """
    if source.is_dir():
        zip_file = _zip_in(source)
    elif source.is_file():
        zip_file = source
    else:
        raise UsageError(
            f"There is no agent {str(source)[:200]!r}: not a file, a folder or a shipped agent (see: drs agents)."
        )
    # the zoo keeps them in a folder named after the zip, the hub and SB3's users beside it
    folders = (zip_file.with_suffix(""), zip_file.parent)
    return Files(
        zip=zip_file,
        normaliser=_first(folders, _NORMALISERS),
        config=_first(folders, ("config.yml",)),
        arguments=_first(folders, ("args.yml",)),
        env_kwargs=_first(folders, ("env_kwargs.yml",)),
    )


def _first(folders: Iterable[Path], names: Iterable[str]) -> Path | None:
    candidates = (folder / name for folder in folders for name in names)
    return next((path for path in candidates if path.is_file()), None)


def _zip_in(folder: Path) -> Path:
    zips = sorted(folder.glob("*.zip"))
    named = [path for path in zips if path.with_suffix("").is_dir()]
    others = [path for path in zips if path.name not in _NOT_AGENTS]
    for choice in (named, others, zips):
        if len(choice) == 1:
            return choice[0]
    if not zips:
        raise UsageError(f"{folder} holds no Stable-Baselines3 zip; give the zip or its folder.")
    raise UsageError(f"{folder} holds several zips ({', '.join(path.name for path in zips)[:200]}); name one.")
