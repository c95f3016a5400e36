"""Compile the helper: ``python -m drs_core.accelerator``; installing the package does the same.

Needs nothing but the standard library, because a wheel is built where nothing else is there.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
SOURCES = tuple(FOLDER / name for name in ("rollout.c", "policy.h", "bullet.h"))
LIBRARY = "rollout.so"
FLAGS = (
    # plain SSE2 (but for one function, see policy.h): what wider vectors leave in the processor slows Bullet
    "-march=x86-64",
    # x * y + z rounds twice, as in numpy
    "-ffp-contract=off",
    "-O3",
    "-fno-math-errno",
    "-std=gnu11",
    "-shared",
    "-fPIC",
    "-fvisibility=default",
    "-Wall",
    "-Wextra",
)
_COMPILERS = ("cc", "gcc", "clang")
_DEADLINE_S = 120


class NotBuilt(Exception):
    """Why there is no helper, in one sentence."""


def source_digest() -> str:
    """Sha256 of the sources, hexadecimal; a helper carries that of what it was made from."""
    digest = hashlib.sha256()
    for source in SOURCES:
        digest.update(source.read_bytes())
    return digest.hexdigest()


def compiler() -> str | None:
    """Path of a C compiler, if there is one; the variable CC names another."""
    named = os.environ.get("CC")
    return shutil.which(named) if named else next(filter(None, map(shutil.which, _COMPILERS)), None)


def build(folder: Path = FOLDER) -> Path:
    """Compile the helper into a folder.

    Raises:
        NotBuilt: there is no compiler, it failed, or PyBullet has no wheels for this kind of machine.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise NotBuilt(f"the helper is for x86-64 Linux, not {platform.machine()} {sys.platform}")
    cc = compiler()
    if cc is None:
        raise NotBuilt("there is no C compiler")
    target = folder / LIBRARY
    unfinished = folder / f".{LIBRARY}.{os.getpid()}"
    digest = f'-DDRS_SOURCE_DIGEST="{source_digest()}"'
    try:
        done = subprocess.run(
            [cc, *FLAGS, digest, str(SOURCES[0]), "-o", str(unfinished), "-ldl", "-lm"],
            capture_output=True,
            text=True,
            timeout=_DEADLINE_S,
        )
        if done.returncode:
            raise NotBuilt(f"{cc} failed: {done.stderr.strip()[:2000]}")
        # a process that has the old one loaded keeps it
        unfinished.replace(target)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotBuilt(f"{cc} could not write {target}: {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return target
