"""What one input may cost and touch: processor time, memory, and files outside one folder."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

TIME_LIMIT_S = 2.0
MEMORY_LIMIT = 512 * 2**20
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_OURS = (sys.prefix, sys.base_prefix, str(Path(__file__).resolve().parents[2]))
_TWO_PATHS = {"os.rename", "os.link", "os.symlink"}
_ONE_PATH = {"os.mkdir", "os.remove", "os.rmdir", "os.truncate"}
_NEVER = {
    *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.forkpty", "pty.spawn"),
    *("socket.connect", "socket.bind", "pickle.find_class", "ctypes.dlopen"),
}


class TooSlow(BaseException):
    """An input took too long; no `except Exception` takes this for damage."""


@contextmanager
def time_limit(limit_s: float = TIME_LIMIT_S) -> Iterator[None]:
    """Raise TooSlow after so much processor time: a machine that is busy with other things is not to blame."""

    def too_slow(number: int, frame: FrameType | None) -> NoReturn:
        raise TooSlow(f"more than {limit_s} s of processor time")

    before = signal.signal(signal.SIGPROF, too_slow)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def limit_memory(more_bytes: int = MEMORY_LIMIT) -> None:
    """This process gets no more than what it has and so much."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + more_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def peak_mb() -> float:
    """Most memory that this process ever had in use [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


class Watch:
    """Notes whatever this process does outside a folder from now on; an audit hook cannot be taken off again."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._seen = str(folder.resolve()), list[str]()
        sys.addaudithook(self._hook)

    def take(self) -> list[str]:
        """What was noted since the last time."""
        seen, self._seen = self._seen, []
        return seen

    def _hook(self, event: str, arguments: tuple[object, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            if isinstance(flags, int) and flags & _WRITING:
                self._look(event, path)
        elif event in _ONE_PATH:
            self._look(event, arguments[0], arguments[-1])
        elif event in _TWO_PATHS:
            for path in arguments[:2]:
                self._look(event, path)
        elif event == "exec":
            # a module of Python, of a package or of ours that is imported late
            source = str(getattr(arguments[0], "co_filename", ""))
            if not source.startswith(_OURS):
                self._seen.append(f"exec of {source[:200]!r}")
        elif event in _NEVER and arguments != (None,):  # ctypes.dlopen(None) is this process itself
            self._seen.append(f"{event} {str(arguments)[:200]}")

    def _look(self, event: str, path: object, folder: object = -1) -> None:
        if isinstance(path, (str, bytes, os.PathLike)):
            # shutil.rmtree names files below a descriptor of their folder
            above = os.readlink(f"/proc/self/fd/{folder}") if isinstance(folder, int) and folder >= 0 else ""
            # as it will be found: with links followed, but where the link itself is what goes
            whole = os.path.join(above, os.fsdecode(path))
            found = os.path.realpath(whole) if event == "open" else os.path.realpath(os.path.dirname(whole) or ".")
            if found != os.devnull and not f"{found}/".startswith(f"{self._folder}/"):
                self._seen.append(f"{event} {found}")
