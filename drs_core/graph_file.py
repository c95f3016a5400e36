"""The parameter file of a graph, checked before any node starts: ROS passes over names that no node has."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from drs_core.errors import UsageError, shown
from drs_core.node_parameters import EVERY, NODES, is_of_ros, is_slip, nearest
from drs_core.plain_yaml import read_plain_yaml

_BODY = "ros__parameters"
_SHORT = {node.removesuffix("_node"): node for node in NODES}


def check_graph_file(path: Path) -> None:
    """Look at every name in a parameter file; sections of nodes that are not of drs are left alone.

    Raises:
        UsageError: it is no parameter file, or names a parameter that its node does not have.
    """
    content = read_plain_yaml(path)
    if not isinstance(content, dict):
        raise UsageError(f"{path} does not hold node names with {_BODY} below.")
    for section, body in _sections(path, content, ""):
        node = section.rsplit("/", 1)[-1]
        if re.fullmatch(r"simulator_\d+", node):
            node = "simulator_node"
        if node in ("*", "**"):
            known, who = EVERY, "no node of drs has"
        elif node in NODES:
            known, who = NODES[node], f"{node} does not have"
        else:
            _check_node(path, section, node, [*_names(body, "")])
            continue
        for name in _names(body, ""):
            if name in known or is_of_ros(name):
                continue
            # a section for all nodes is for those of others, too
            if known is not EVERY or is_slip(name, EVERY):
                raise UsageError(
                    f"{path}: the section {shown(section)} sets {shown(name)}, which {who}; {nearest(name, known)}"
                )


def _sections(path: Path, content: Mapping[Any, Any], above: str) -> Iterator[tuple[str, Mapping[Any, Any]]]:
    """Each node's name, with the namespaces around it, and its parameters."""
    for key, value in content.items():
        if key == _BODY and above and isinstance(value, dict | None):
            yield above, value or {}
        elif key != _BODY and isinstance(value, dict):
            yield from _sections(path, value, f"{above}/{key}" if above else f"{key}")
        else:
            raise UsageError(f"{path}: {shown(key)} stands where node names with {_BODY} below belong.")


def _names(body: Mapping[Any, Any], above: str) -> Iterator[str]:
    """Names of parameters as ROS makes them: with a point where a mapping holds another one."""
    for key, value in body.items():
        if isinstance(value, dict):
            yield from _names(value, f"{above}{key}.")
        else:
            yield f"{above}{key}"


def _check_node(path: Path, section: str, node: str, names: Sequence[str]) -> None:
    """Refuse a slip in a node's name; a section of another node is left alone, also of a second one of drs."""
    close = get_close_matches(node, [*NODES, *_SHORT], 1, 0.85)
    ours = bool(names) and all(name in EVERY for name in names)
    if close and ours and not node.startswith(tuple(f"{known}_" for known in NODES)):
        meant = _SHORT.get(close[0], close[0])
        raise UsageError(f"{path}: the section {shown(section)} is for no node of drs; did you mean {meant!r}?")
