"""Agents on a Hugging Face hub: only the few files of an agent are fetched, their sizes checked first."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from drs_core.errors import DrsError, UsageError, install

PREFIX = "hf:"
MAX_FILES_BYTES = 512 * 2**20
_ID = re.compile(r"[\w.-]{1,96}/[\w.-]{1,96}")
_WANTED = re.compile(
    r"config\.yml|args\.yml|env_kwargs\.yml|vec_?normalize\.pkl|(?!train_eval_metrics\b|replay).+\.zip"
)


def fetch(source: str) -> Path:
    """Download ``hf:org/name`` into huggingface_hub's cache; HF_ENDPOINT chooses another hub.

    Raises:
        UsageError: it is no hub id, or no agent is there.
        DrsError: the hub does not answer.
    """
    name = source.removeprefix(PREFIX)
    if not _ID.fullmatch(name) or ".." in name:
        raise UsageError(f"{source[:100]!r} is not a hub id; write hf:organisation/name.")
    try:
        from huggingface_hub import HfApi, hf_hub_download
        from huggingface_hub.errors import RepositoryNotFoundError
    except ModuleNotFoundError as error:
        raise DrsError(f"Hub ids need huggingface_hub; {install('cli')}.") from error
    try:
        info = HfApi().model_info(name, files_metadata=True)
        files = [file for file in info.siblings or [] if _wanted(file.rfilename)]
        total = sum(file.size or 0 for file in files)
        if total > MAX_FILES_BYTES:
            raise UsageError(f"{source} holds {total} bytes of agent files; at most {MAX_FILES_BYTES} are fetched.")
        if not any(file.rfilename.endswith(".zip") for file in files):
            raise UsageError(f"{source} holds no Stable-Baselines3 zip; choose a repository of an SB3 agent.")
        paths = [Path(hf_hub_download(name, file.rfilename, revision=info.sha)) for file in files]
    except RepositoryNotFoundError as error:
        raise UsageError(f"The hub has no repository {name!r}, or it is private; check the id.") from error
    except UsageError:
        raise
    except Exception as error:  # the client's network errors have no base class that its versions share
        reason = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise DrsError(f"Cannot fetch {source}: {reason}. Check the network and HF_ENDPOINT.") from error
    return min((path.parent for path in paths), key=lambda folder: len(folder.parts))


def _wanted(filename: str) -> bool:
    path = PurePosixPath(filename)
    return len(path.parts) <= 2 and ".." not in path.parts and _WANTED.fullmatch(path.name) is not None
