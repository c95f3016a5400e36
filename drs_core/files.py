"""Files that are whole or absent, and reading without trusting a size."""

from __future__ import annotations

import fcntl
import json
import math
import os
import tempfile
from pathlib import Path
from typing import IO, Any

from drs_core.errors import DrsError, UsageError

_PIECE_BYTES = 2**20


def temporary_name(path: Path, process: int | str = "*") -> str:
    """What a file is called while a process writes it, which one that is killed leaves; by default for glob."""
    return f".{path.name}.{process}.tmp"


def write_atomically(path: Path, content: bytes) -> None:
    """Replace path by content: temporary file, fsync, rename, fsync of the folder.

    Raises:
        DrsError: the folder is missing, read-only or full; what path held is untouched.
    """
    temporary = path.with_name(temporary_name(path, os.getpid()))
    try:
        try:
            # never through a link that lies there already
            temporary.unlink(missing_ok=True)
            with open(temporary, "xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        sync_folder(path.parent)
    except OSError as error:
        raise DrsError(
            f"Cannot write {path}: {error.strerror}. Choose a folder with room that you may write."
        ) from error


def clear_unfinished(path: Path) -> None:
    """Remove what processes that were killed left of writing this file; only where no other one writes it now."""
    for left in path.parent.glob(temporary_name(path)):
        left.unlink(missing_ok=True)


def refuse_link(path: Path) -> None:
    """Raise UsageError where what would be added to is a link to another place."""
    if path.is_symlink():
        raise UsageError(f"{path} is a link, and nothing is written through it; put the file itself there.")


def check_output(path: Path, force: bool) -> None:
    """Find out before the work that its result, an agent file, could not be kept.

    Raises:
        UsageError: the name, the folder or what is there already is in the way.
    """
    if path.suffix != ".safetensors":
        raise UsageError(f"An agent file is called *.safetensors, not {path.name}.")
    check_writable(path, force)


def check_writable(path: Path, force: bool) -> None:
    """Find out before the work that a file could not be written.

    Raises:
        UsageError: it is a folder, it exists and nobody said to replace it, or its folder does not exist or
            cannot be written.
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file.")
    if path.exists() and not force:
        raise UsageError(f"{path} exists already; choose another name or say --force.")
    folder = path.absolute().parent
    if not folder.is_dir():
        raise UsageError(f"The folder {folder} does not exist; make it first.")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise UsageError(
            f"Cannot write into {folder}: {error.strerror}; choose a folder that you may write."
        ) from error


def make_folder(path: Path) -> None:
    """Make a folder, and those it lies in, unless it is there.

    Raises:
        UsageError: a file is in the way.
        DrsError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise UsageError(f"{path} is no folder, or lies in none: a file is there; choose another one.") from error
    except OSError as error:
        raise DrsError(f"Cannot make the folder {path}: {error.strerror}; choose another one.") from error


def sync_folder(folder: Path) -> None:
    """Make a rename or a new name in this folder survive a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def lock_folder(folder: Path) -> IO[str]:
    """Keep other processes out until the returned file is closed, or this process ends in any way.

    Raises:
        UsageError: another one is at work here.
        DrsError: the folder cannot be written.
    """
    try:
        # not through a link: a folder from elsewhere would choose what becomes empty
        # and without waiting: a pipe in its place would never open
        handle = os.open(folder / ".lock", os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK)
        file = open(handle, "w", encoding="utf-8")
    except OSError as error:
        raise DrsError(f"Cannot write {folder}: {error.strerror}; choose a folder that you may write.") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise UsageError(f"Another process works in {folder}; wait for it or choose another folder.") from error
    return file


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """The content of a regular file of at most `most_bytes`.

    Raises:
        UsageError: it does not exist, is no regular file, cannot be read or is larger.
    """
    try:
        if not path.is_file():
            raise UsageError(f"{path} is not a file; check the path.")
        content = bytearray()
        with open(path, "rb") as file:
            # in pieces: read(n) takes n bytes of memory first, however small the file is
            while len(content) <= most_bytes and (piece := file.read(min(_PIECE_BYTES, most_bytes + 1))):
                content += piece
    except OSError as error:
        raise UsageError(f"Cannot read {path}: {error.strerror}.") from error
    if len(content) > most_bytes:
        raise UsageError(f"{path} is larger than {most_bytes} bytes, the most that is read for such a file.")
    return bytes(content)


def parse_json(text: str | bytes, name: str) -> Any:
    """JSON without NaN, Infinity and texts that cannot be written again.

    Raises:
        UsageError: it is not such JSON.
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is not allowed")

    def finite(number: str) -> float:
        # 1e999 is JSON, and would be written as Infinity
        value = float(number)
        if not math.isfinite(value):
            raise ValueError(f"{number[:40]} is too large")
        return value

    try:
        value = json.loads(text, parse_constant=refuse, parse_float=finite)
        content = text.encode(errors="surrogatepass") if isinstance(text, str) else text
        if b"\\ud" in content.lower():
            # half of a pair of surrogates: it has no encoding, and would break whatever shows it
            json.dumps(value, ensure_ascii=False).encode()
        return value
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{name} is not valid JSON: {str(error)[:200]}.") from error
