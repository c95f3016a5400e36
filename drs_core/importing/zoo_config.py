"""config.yml, args.yml and env_kwargs.yml of the zoo: YAML with Python tags, read as plain data."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drs_core.errors import UsageError, shown
from drs_core.plain_yaml import read_plain_yaml

_FALSE: tuple[Any, ...] = (None, False, "", "None", "none", "null", [], {}, ())


def read_yaml(path: Path) -> dict[str, Any]:
    """A zoo YAML file as a mapping; ``OrderedDict`` tags (a list of pairs in a list) included.

    Raises:
        UsageError: it is not such a file.
    """
    content = read_plain_yaml(path)
    if isinstance(content, list) and len(content) == 1:
        try:
            content = dict(content[0])
        except (TypeError, ValueError) as error:
            raise UsageError(f"{path} does not hold a mapping.") from error
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
    if config.get("frame_stack") not in (*_FALSE, 1):
        raise UsageError(f"{name} stacks {shown(config['frame_stack'])} frames; only single observations can be tuned.")
    if set(env_kwargs) - {"render_mode"}:
        raise UsageError(f"{name} makes its environment with {shown(env_kwargs)}; only plain environments work.")
    if config.get("vec_env_wrapper") not in _FALSE:
        raise UsageError(f"{name} was trained in the wrapper {shown(config['vec_env_wrapper'])}; it is not known.")
    timed = False
    for wrapper in _wrappers(config.get("env_wrapper"), name):
        if wrapper.rpartition(".")[2] != "TimeFeatureWrapper":
            raise UsageError(f"{name} was trained in the wrapper {shown(wrapper)}; only TimeFeatureWrapper is known.")
        timed = True
    return Wrapping(_normalises_observations(config), timed)


def _wrappers(value: Any, name: str) -> list[str]:
    if value in _FALSE:
        return []
    names = []
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, dict):
            if any(arguments not in _FALSE for arguments in item.values()):
                raise UsageError(f"{name} gives its wrapper arguments, {shown(item)}; only plain wrappers work.")
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
