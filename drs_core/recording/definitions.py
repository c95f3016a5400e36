"""Definitions of messages as text, which a recording carries so that any tool can read it."""

from __future__ import annotations

import re
from collections.abc import Callable

Read = Callable[[str, str], str]
"""Package and name of a message -> the text of its .msg file."""

OBSERVATION_TYPE = "drs_interfaces/msg/Observation"
ACTION_TYPE = "drs_interfaces/msg/Action"

_SEPARATOR = "=" * 80
_PRIMITIVE = {
    *("bool", "byte", "char", "float32", "float64", "string", "wstring"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}
_FIELD = re.compile(r"^([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*\b(?!\s*=)")

_HEADER = """builtin_interfaces/Time stamp
string frame_id"""
_TIME = """int32 sec
uint32 nanosec"""


def _with_header(fields: str) -> str:
    parts = (fields.strip(), f"MSG: std_msgs/Header\n{_HEADER}", f"MSG: builtin_interfaces/Time\n{_TIME}")
    return f"\n{_SEPARATOR}\n".join(parts)


OBSERVATION = _with_header("""
int8 SUCCESS_UNDEFINED=-1
int8 SUCCESS_NO=0
int8 SUCCESS_YES=1
std_msgs/Header header
uint64 number
uint64 episode_seed
uint32 step
string environment
string[] keys
uint32[] sizes
float64[] values
float64 reward
bool terminated
bool truncated
int8 success
""")
ACTION = _with_header("""
std_msgs/Header header
uint64 observation
float32[] values
""")
"""What this version reads. A file that defines them otherwise is refused, since a definition decides how much
is read and how often, and a file is not to be trusted with that."""
KNOWN = {OBSERVATION_TYPE: OBSERVATION, ACTION_TYPE: ACTION}


def whole_definition(kind: str, read: Read) -> str:
    """The definition of a message and of all that it is made of, as rosbag2 and Foxglove take it.

    Args:
        kind: such as ``sensor_msgs/msg/JointState``.
        read: finds the text of one message.
    """
    package, _, name = kind.split("/")
    parts, waiting, seen = [read(package, name)], _parts_of(read(package, name), package), {(package, name)}
    while waiting:
        part = waiting.pop(0)
        if part not in seen:
            seen.add(part)
            text = read(*part)
            parts.append(f"MSG: {part[0]}/{part[1]}\n{text}")
            waiting += _parts_of(text, part[0])
    return f"\n{_SEPARATOR}\n".join(text.strip() for text in parts)


def normalised(definition: str) -> str:
    """A definition without comments, empty lines and spaces that mean nothing."""
    lines = (" ".join(line.split("#", 1)[0].split()) for line in definition.splitlines())
    return "\n".join(line for line in lines if line)


def _parts_of(text: str, package: str) -> list[tuple[str, str]]:
    kinds = [match[1] for line in text.splitlines() if (match := _FIELD.match(line.strip()))]
    named = [kind for kind in kinds if kind not in _PRIMITIVE]
    return [(kind.split("/")[0], kind.split("/")[-1]) if "/" in kind else (package, kind) for kind in named]
