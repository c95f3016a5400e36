"""config.yml, args.yml and env_kwargs.yml of the zoo: YAML with Python tags, read as plain data."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from drs_core.errors import UsageError
from drs_core.files import read_bounded

MAX_YAML_BYTES = 2**20
_FALSE: tuple[Any, ...] = (None, False, "", "None", "none", "null", [], {}, ())


class _PlainLoader(yaml.SafeLoader):
    """Builds only mappings, lists and scalars, whatever tag stands before them."""


def _plain(loader: yaml.SafeLoader, _: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    return loader.construct_scalar(node)  # type: ignore[arg-type]


_PlainLoader.add_multi_constructor("tag:yaml.org,2002:python/", _plain)


def read_yaml(path: Path) -> dict[str, Any]:
    """A zoo YAML file as a mapping; ``OrderedDict`` tags (a list of pairs in a list) included.

    Raises:
        UsageError: it is not such a file.
    """
    loader = _PlainLoader(read_bounded(path, MAX_YAML_BYTES))
    try:
        content = loader.get_single_data()
        if isinstance(content, list) and len(content) == 1:
            content = dict(content[0])
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise UsageError(f"{path} is not a readable YAML file ({str(error).splitlines()[0][:120]}).") from error
    finally:
        loader.dispose()
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise UsageError(f"{path} does not hold a mapping.")
    return content


@dataclass(frozen=True)
class Wrapping:
    """What stood between environment and policy in training.

    Attributes:
        normalised: whether observations went through a VecNormalize.
        time_feature: whether a TimeFeatureWrapper added the remaining time.
    """

    normalised: bool = False
    time_feature: bool = False


def wrapping(config: dict[str, Any], env_kwargs: dict[str, Any], name: str) -> Wrapping:
    """Which wrappers a zoo configuration asks for.

    Raises:
        UsageError: it asks for one that is not reproduced here.
    """
    if config.get("frame_stack") not in _FALSE:
        raise UsageError(f"{name} stacks {config['frame_stack']} frames; only single observations can be tuned.")
    if set(env_kwargs) - {"render_mode"}:
        raise UsageError(f"{name} makes its environment with {str(env_kwargs)[:80]}; only plain environments work.")
    timed = False
    for wrapper in _wrappers(config.get("env_wrapper"), name):
        if wrapper.rpartition(".")[2] != "TimeFeatureWrapper":
            raise UsageError(f"{name} was trained in the wrapper {wrapper[:80]}; only TimeFeatureWrapper is known.")
        timed = True
    return Wrapping(_normalises_observations(config), timed)


def _wrappers(value: Any, name: str) -> list[str]:
    if value in _FALSE:
        return []
    names = []
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, dict):
            if any(arguments not in _FALSE for arguments in item.values()):
                raise UsageError(f"{name} gives its wrapper arguments, {str(item)[:80]}; only plain wrappers work.")
            names += [str(key) for key in item]
        else:
            names.append(str(item))
    return names


def _normalises_observations(config: dict[str, Any]) -> bool:
    value = config.get("normalize")
    if isinstance(value, str):
        # a dictionary as text: "{'norm_obs': False}" or "dict(norm_obs=False)"
        return value not in ("False", "") and not re.search(r"norm_obs['\"]?\s*[:=]\s*False", value)
    kwargs = config.get("normalize_kwargs")
    if isinstance(kwargs, dict) and kwargs.get("norm_obs") is False:
        return False
    return bool(value)
