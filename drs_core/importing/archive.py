"""Zip archives that may be hostile: members are read in memory, under names and sizes checked first."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import PurePosixPath

from drs_core.errors import UsageError

MAX_MEMBERS = 1000
MAX_MEMBER_BYTES = 256 * 2**20
MAX_RATIO = 200


class Archive:
    """A zip archive held in memory."""

    def __init__(self, content: bytes, name: str) -> None:
        """Check every member's name and size.

        Raises:
            UsageError: it is no zip archive, or a member's name or size has no place in one.
        """
        self._name = name
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(content))
            members = self._zip.infolist()
        except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
            raise UsageError(f"{name} is not a readable zip archive ({error}).") from error
        if len(members) > MAX_MEMBERS:
            raise UsageError(f"{name} is refused: it has {len(members)} members, at most {MAX_MEMBERS} are read.")
        for member in members:
            path = PurePosixPath(member.filename.replace("\\", "/"))
            if path.is_absolute() or ".." in path.parts:
                raise UsageError(f"{name} is refused: its member {member.filename[:80]!r} points outside the archive.")
            if member.file_size > MAX_MEMBER_BYTES or member.file_size > MAX_RATIO * max(member.compress_size, 1024):
                raise UsageError(
                    f"{name} is refused: its member {member.filename[:80]!r} unpacks to {member.file_size} bytes "
                    f"from {member.compress_size}; at most {MAX_MEMBER_BYTES} bytes and {MAX_RATIO} times are read."
                )
        self.names = [member.filename for member in members]

    def read(self, member: str, most_bytes: int = MAX_MEMBER_BYTES) -> bytes:
        """The content of a member.

        Raises:
            UsageError: it is missing, damaged or larger than `most_bytes`.
        """
        if member not in self.names:
            raise UsageError(f"{self._name} has no member {member!r}: it is not what its name says.")
        try:
            with self._zip.open(member) as file:
                # one byte more than promised would show a header that lies
                size = self._zip.getinfo(member).file_size
                if size > most_bytes:
                    raise UsageError(
                        f"{self._name} is refused: its member {member!r} has more than {most_bytes} bytes."
                    )
                content = file.read(size + 1)
        except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, NotImplementedError) as error:
            raise UsageError(f"{self._name} is damaged: its member {member!r} cannot be read ({error}).") from error
        if len(content) != size:
            raise UsageError(f"{self._name} is damaged: its member {member!r} has not the size that it states.")
        return content
