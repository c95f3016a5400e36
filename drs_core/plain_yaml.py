"""YAML as plain data: mappings, lists and scalars, whatever tags and references stand in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drs_core.errors import UsageError, shown
from drs_core.files import read_bounded

MAX_BYTES = 2**16
MAX_DEPTH = 50
"""The time to read lists within lists within lists … grows with the square of their number, and more."""


def read_plain_yaml(path: Path) -> Any:
    """The content of a YAML file; a Python tag, as the zoo's files have, is passed over.

    Raises:
        UsageError: it is not a readable YAML file, is too large or too deep, or refers back to parts of itself.
    """
    import yaml

    content = read_bounded(path, MAX_BYTES)
    try:
        depth = 0
        for event in yaml.parse(content, Loader=yaml.SafeLoader):
            # a few lines of references to references unfold to gigabytes
            if isinstance(event, yaml.AliasEvent):
                raise UsageError(f"{path} refers back to parts of itself (YAML aliases); write them out.")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise UsageError(f"{path} has lists or mappings {depth} deep; at most {MAX_DEPTH} are read.")
        loader = _loader(path)(content)
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        reason = " ".join(str(error).split())[:160]
        raise UsageError(f"{path} is not a readable YAML file ({reason}).") from error


def quoted(text: str) -> str:
    """A text as YAML that takes it for nothing else, not for a number, a truth or a list; in ASCII.

    JSON would not do: it writes characters such as emoji as two, which YAML does not read.

    Raises:
        UsageError: it is a path whose bytes are not UTF-8, which YAML cannot hold.
    """
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise UsageError(f"{shown(text)} is not text in UTF-8; use another name.")
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    return character if " " <= character <= "~" else f"\\U{ord(character):08X}"


def _loader(path: Path) -> Any:
    """The class that makes plain data of the file's content."""
    import yaml

    class PlainLoader(yaml.SafeLoader):
        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
            seen = set()
            for name in (key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
                # YAML itself takes the last one, whatever the writer meant
                if name in seen:
                    raise UsageError(f"{path} gives {shown(name)} twice; keep one.")
                seen.add(name)
            return super().construct_mapping(node, deep)

    def plain(loader: yaml.SafeLoader, _: str, node: yaml.Node) -> Any:
        if isinstance(node, yaml.MappingNode):
            return loader.construct_mapping(node, deep=True)
        if isinstance(node, yaml.SequenceNode):
            return loader.construct_sequence(node, deep=True)
        return loader.construct_scalar(node)  # type: ignore[arg-type]

    PlainLoader.add_multi_constructor("tag:yaml.org,2002:python/", plain)
    return PlainLoader
