"""Which agent a name in a request means: never a path, so that no client reaches beyond one folder."""

from __future__ import annotations

import re
from pathlib import Path

from drs_core.agent import SUFFIX, Agent, load
from drs_core.agents import shipped
from drs_core.errors import UsageError
from drs_core.importing import resolve

_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}")


def plain_name(name: str) -> str:
    """The name itself.

    Raises:
        UsageError: it is not plain: it could lead out of a folder.
    """
    if not _PLAIN.fullmatch(name) or ".." in name:
        raise UsageError(f"{name[:100]!r} is not a plain name: letters, digits and _ . - only, no folders.")
    return name


def requested_agent(name: str, own: str, root: str) -> tuple[str, Agent]:
    """The agent that a request names, with its name.

    Args:
        name: from the request; empty means `own`.
        own: the node's parameter `agent`, set by whoever started the node: a shipped name or a file.
        root: folder in which other names are looked up: NAME.safetensors, or the run folder NAME.

    Raises:
        UsageError: there is none of that name, or it cannot be used.
    """
    if not name or name == own:
        if not own:
            raise UsageError("No agent is named, and the parameter agent is empty; name one.")
        return own, resolve(own)
    plain = plain_name(name)
    if plain in shipped():
        return plain, load(shipped()[plain])
    stem = plain.removesuffix(SUFFIX)
    for path in (Path(root) / f"{stem}{SUFFIX}", Path(root) / plain / f"agent{SUFFIX}"):
        if path.is_file():
            return plain, load(path)
    raise UsageError(f"There is no agent {plain!r}: neither shipped ({', '.join(shipped())}) nor in {root or '.'}.")
