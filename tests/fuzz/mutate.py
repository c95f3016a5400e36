"""Damage and malice, as pure functions (content, rng) -> content: of bytes, of JSON, of zips, of MCAP records."""

from __future__ import annotations

import io
import json
import re
import struct
import warnings
import zipfile
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

Mutation = Callable[[bytes, Random], bytes]

NAMES = (
    "../../x",
    "/etc/passwd",
    "..\\x",
    "x/../../../y",
    "~/x",
    "file:///etc/passwd",
    "",
    ".",
    "..",
    "a\x00b",
    "\x1b[2J",
)
NUMBERS = ("0", "-1", "NaN", "-Infinity", "1e999", "1e308", "-0.0", str(2**31), str(2**63), str(-(2**64)), "9" * 5000)
EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, -(2**64), 10**400, 0.5, -0.0, 1e308, 5e-324),
    *(
        float("nan"),
        float("inf"),
        float("-inf"),
        "",
        "x" * 3000,
        "\ud800",
        "\x1b[2J",
        "a\nb",
        [],
        {},
        [None],
        {"": None},
    ),
    *NAMES,
)
_DEEPEST = 3000
_BOMB = 4 * 2**20


def flipped(content: bytes, rng: Random) -> bytes:
    """One to eight bits are others."""
    changed = bytearray(content)
    for _ in range(rng.randint(1, 8)):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def overwritten(content: bytes, rng: Random) -> bytes:
    """A few bytes in a row are others."""
    at, count = _place(content, rng), rng.randint(1, 16)
    return content[:at] + rng.randbytes(count) + content[at + count :]


def truncated(content: bytes, rng: Random) -> bytes:
    """The end is missing."""
    return content[: _place(content, rng)]


def cut_out(content: bytes, rng: Random) -> bytes:
    """A part in the middle is missing."""
    first, last = sorted((_place(content, rng), _place(content, rng)))
    return content[:first] + content[last:]


def spliced(content: bytes, rng: Random) -> bytes:
    """A part stands at another place too."""
    first, at = _place(content, rng), _place(content, rng)
    return content[:at] + content[first : first + rng.randint(1, 400)] + content[at:]


def length_changed(content: bytes, rng: Random) -> bytes:
    """A binary number, perhaps a length, is an extreme one."""
    form = rng.choice(("<B", "<H", "<I", "<Q", ">I", ">Q"))
    size, at = struct.calcsize(form), _place(content, rng)
    return content[:at] + struct.pack(form, rng.choice(EXTREMES) % 256**size) + content[at + size :]


def number_changed(content: bytes, rng: Random) -> bytes:
    """A number that is written as text is a wild one."""
    return _replaced(content, rng, rb"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", NUMBERS)


def word_changed(content: bytes, rng: Random) -> bytes:
    """A word is one that leads elsewhere."""
    return _replaced(content, rng, rb"[A-Za-z_][\w./-]{2,60}", NAMES)


def nested(content: bytes, rng: Random) -> bytes:
    """Something opens again and again."""
    opened = rng.choice((b"[", b"{", b'{"a":', b"(", b"- ", b"? ", b"\x28", b"!!python/tuple ["))
    at = _place(content, rng)
    return content[:at] + opened * rng.randint(2, _DEEPEST) + content[at:]


ANY = (flipped, overwritten, truncated, cut_out, spliced, length_changed, number_changed, word_changed, nested)


def mutated(content: bytes, rng: Random, mutations: Sequence[Mutation] = ANY) -> bytes:
    """One mutation, or several, one after the other."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        content = rng.choice(mutations)(content, rng)
    return content


def json_changed(content: bytes, rng: Random) -> bytes:
    """One value is a wild one, or gone; what is no JSON is damaged in another way."""
    try:
        value = json.loads(content)
    except (ValueError, RecursionError):
        return mutated(content, rng)
    return json.dumps(value_changed(value, rng)).encode()


def value_changed(value: Any, rng: Random) -> Any:
    """The same value with something in it replaced, left out or doubled."""
    if isinstance(value, (dict, list)) and value and rng.random() < 0.85:
        keys = list(value) if isinstance(value, dict) else range(len(value))
        key, changed = rng.choice(keys), value.copy()
        if rng.random() < 0.1:
            del changed[key]
        elif rng.random() < 0.05:
            changed = {**changed, rng.choice(NAMES): 1} if isinstance(changed, dict) else changed * rng.randint(2, 500)
        else:
            changed[key] = value_changed(value[key], rng)
        return changed
    if isinstance(value, str) and value.startswith("{") and rng.random() < 0.9:
        return json_changed(value.encode("utf-8", "replace"), rng).decode("utf-8", "replace")
    return rng.choice(VALUES)


def lines_changed(content: bytes, rng: Random) -> bytes:
    """One of several lines of JSON is changed, left out or doubled."""
    lines = content.split(b"\n")
    at = rng.randrange(len(lines))
    what = rng.random()
    new = [] if what < 0.1 else [lines[at]] * 2 if what < 0.2 else [json_changed(lines[at], rng)]
    return b"\n".join([*lines[:at], *new, *lines[at + 1 :]])


def safetensors_changed(content: bytes, rng: Random) -> bytes:
    """The header says something else, with a length that fits it, mostly."""
    size = struct.unpack("<Q", content[:8].ljust(8, b"\0"))[0]
    header = json_changed(content[8 : 8 + size], rng)
    stated = len(header) if rng.random() < 0.95 else rng.choice(EXTREMES)
    return struct.pack("<Q", stated) + header + content[8 + size :]


def zip_changed(content: bytes, rng: Random, inner: Mutation = mutated) -> bytes:
    """A member has another content or name, is missing, doubled or a bomb; `inner` changes contents."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    except Exception:  # damaged already, in any of the ways that a zip can be
        return mutated(content, rng)
    at, what = rng.randrange(len(members)), rng.random()
    name, old = members[at]
    if what < 0.75:
        members[at] = (name, zip_changed(old, rng, inner) if old.startswith(b"PK") else inner(old, rng))
    elif what < 0.85:
        members[at] = (rng.choice(NAMES) or "x", old)
    elif what < 0.9:
        del members[at]
    elif what < 0.95:
        members[at] = (name, bytes(_BOMB))
    else:
        members += [members[at]] * rng.randint(1, 3)
    return zipped(members, zipfile.ZIP_DEFLATED if rng.random() < 0.3 or what > 0.9 else zipfile.ZIP_STORED)


def zipped(members: Sequence[tuple[str, bytes]], method: int = zipfile.ZIP_STORED) -> bytes:
    """A zip archive of these members, doubled names included."""
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", method) as archive:
        warnings.simplefilter("ignore")
        for name, content in members:
            archive.writestr(name, content)
    return buffer.getvalue()


def chunks_changed(content: bytes, rng: Random) -> bytes:
    """The records of an MCAP file without its checksums, one chunk changed within."""
    records, chunks = _records(content), []
    for at, (opcode, body) in enumerate(records):
        if opcode == 6 and len(body) > 40:
            chunks.append(at)
    if not chunks:
        return mutated(content, rng)
    at = rng.choice(chunks)
    body = records[at][1]
    named = struct.unpack_from("<I", body, 28)[0]
    start = 32 + named + 8
    data = mutated(body[start:], rng)
    # no checksum, the compression as it was said to be
    new = body[:24] + bytes(4) + body[28 : 32 + named] + struct.pack("<Q", len(data)) + data
    records[at] = (6, new)
    return content[:8] + b"".join(struct.pack("<BQ", opcode, len(b)) + b for opcode, b in records) + content[-8:]


def _records(content: bytes) -> list[tuple[int, bytes]]:
    found, at = [], 8
    while at + 9 <= len(content) - 8:
        opcode, size = struct.unpack_from("<BQ", content, at)
        found.append((opcode, content[at + 9 : at + 9 + size]))
        at += 9 + size
    return found


def _place(content: bytes, rng: Random) -> int:
    return rng.randint(0, len(content))


def _replaced(content: bytes, rng: Random, pattern: bytes, by: Sequence[str]) -> bytes:
    found = list(re.finditer(pattern, content[:100_000]))
    if not found:
        return overwritten(content, rng)
    match = rng.choice(found)
    return content[: match.start()] + rng.choice(by).encode() + content[match.end() :]
