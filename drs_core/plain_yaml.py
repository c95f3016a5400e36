"""YAML as plain data: mappings, lists and scalars, whatever tags and references stand in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drs_core.errors import UsageError
from drs_core.files import read_bounded

MAX_BYTES = 2**20


def read_plain_yaml(path: Path) -> Any:
    """The content of a YAML file; a Python tag, as the zoo's files have, is passed over.

    Raises:
        UsageError: it is not a readable YAML file, or refers back to parts of itself.
    """
    import yaml

    class PlainLoader(yaml.SafeLoader):
        pass

    def plain(loader: yaml.SafeLoader, _: str, node: yaml.Node) -> Any:
        if isinstance(node, yaml.MappingNode):
            return loader.construct_mapping(node, deep=True)
        if isinstance(node, yaml.SequenceNode):
            return loader.construct_sequence(node, deep=True)
        return loader.construct_scalar(node)  # type: ignore[arg-type]

    PlainLoader.add_multi_constructor("tag:yaml.org,2002:python/", plain)
    content = read_bounded(path, MAX_BYTES)
    try:
        # a few lines of references to references unfold to gigabytes
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(content, Loader=yaml.SafeLoader)):
            raise UsageError(f"{path} refers back to parts of itself (YAML aliases); write them out.")
        loader = PlainLoader(content)
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        reason = " ".join(str(error).split())[:160]
        raise UsageError(f"{path} is not a readable YAML file ({reason}).") from error
