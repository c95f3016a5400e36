"""A Stable-Baselines3 agent on disk -> Agent, without executing anything from its files."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drs_core.agent import Agent
from drs_core.environments import Spaces, current_name, describe
from drs_core.errors import UsageError
from drs_core.files import read_bounded
from drs_core.importing.layers import ALGORITHMS, build, infer_algorithm
from drs_core.importing.locate import Files, locate
from drs_core.importing.normaliser import MAX_PICKLE_BYTES, Normaliser, read_normaliser
from drs_core.importing.sb3_zip import MAX_ZIP_BYTES, Saved, read_zip
from drs_core.importing.zoo_config import Wrapping, read_yaml, wrapping
from drs_core.observation import MAIN, Part, Pipeline


@dataclass(frozen=True)
class Hints:
    """What the caller knows better than the files; None where they decide.

    Attributes:
        environment: gymnasium id.
        algorithm: one of the six.
        normaliser: path of a vecnormalize.pkl.
        time_feature: whether the agent was trained in a TimeFeatureWrapper.
    """

    environment: str | None = None
    algorithm: str | None = None
    normaliser: Path | None = None
    time_feature: bool | None = None


def import_saved(source: Path, hints: Hints) -> Agent:
    """Import a zip or a zoo folder.

    Raises:
        UsageError: the agent is of a kind that cannot be run here, or does not fit the environment.
    """
    files = locate(source)
    content = read_bounded(files.zip, MAX_ZIP_BYTES)
    saved = read_zip(content, files.zip.name)
    arguments = read_yaml(files.arguments) if files.arguments else {}
    try:
        algorithm = _algorithm(files, saved, arguments, hints)
        network, theta = build(algorithm, saved.tensors, saved.policy_kwargs, saved.gsde)
        environment = _environment(files, arguments, hints)
        spaces = describe(environment)
        wrapped = _wrapping(files, arguments, hints)
        timed = wrapped.time_feature
        _check_sizes(environment, spaces, network.sizes, timed)
        pipeline = _pipeline(spaces, timed, _normaliser(files, wrapped, hints))
    except UsageError as error:
        text = str(error)
        raise UsageError(text if files.zip.name in text else f"{files.zip.name}: {text}") from error
    return Agent(
        environment=environment,
        pipeline=pipeline,
        network=network,
        low=spaces.low,
        high=spaces.high,
        theta=theta,
        source={
            "algorithm": algorithm,
            "file": files.zip.name,
            "sha256": hashlib.sha256(content).hexdigest(),
            "stable_baselines3": saved.version,
        },
    )


def _algorithm(files: Files, saved: Saved, arguments: dict[str, Any], hints: Hints) -> str:
    inferred = infer_algorithm(saved.tensors, saved.data)
    declared = hints.algorithm or arguments.get("algo") or inferred
    algorithm = str(declared).lower()[:40]
    if algorithm not in ALGORITHMS:
        raise UsageError(f"its algorithm {algorithm!r} is not one of those that can be tuned: {', '.join(ALGORITHMS)}.")
    return algorithm


def _environment(files: Files, arguments: dict[str, Any], hints: Hints) -> str:
    for candidate in (hints.environment, arguments.get("env")):
        if candidate:
            return current_name(str(candidate))
    # HopperBulletEnv-v0.zip in the zoo, a2c-HopperBulletEnv-v0.zip on the hub
    stem = re.fullmatch(rf"(?:(?:{'|'.join(ALGORITHMS)})-)?(.+-v\d+)", files.zip.stem)
    if stem:
        return current_name(stem[1])
    raise UsageError("its environment is not stated in the file; say it with --env ID.")


def _wrapping(files: Files, arguments: dict[str, Any], hints: Hints) -> Wrapping:
    config = read_yaml(files.config) if files.config else {}
    env_kwargs = read_yaml(files.env_kwargs) if files.env_kwargs else {}
    stated = arguments.get("env_kwargs")
    env_kwargs = env_kwargs or (stated if isinstance(stated, dict) else {})
    # without a configuration, a normaliser that lies beside the zip is meant
    asked = wrapping(config, env_kwargs, files.zip.name) if files.config else Wrapping(files.normaliser is not None)
    timed = asked.time_feature if hints.time_feature is None else hints.time_feature
    return Wrapping(asked.normalised, timed)


def _normaliser(files: Files, wrapped: Wrapping, hints: Hints) -> Normaliser | None:
    path = hints.normaliser or (files.normaliser if wrapped.normalised else None)
    if path is None:
        if wrapped.normalised:
            raise UsageError(
                "its config.yml says that observations are normalised, but there is no vecnormalize.pkl; "
                "give it with --vecnormalize FILE."
            )
        return None
    return read_normaliser(read_bounded(path, MAX_PICKLE_BYTES), path.name)


def _pipeline(spaces: Spaces, timed: bool, normaliser: Normaliser | None) -> Pipeline:
    if normaliser is None:
        normaliser = Normaliser({}, Pipeline.clip, Pipeline.epsilon)
    unknown = set(normaliser.moments) - set(spaces.parts)
    if unknown:
        raise UsageError(
            f"its normaliser has statistics of {sorted(unknown)}, the environment observes {[*spaces.parts]}."
        )
    parts = []
    for key, size in spaces.parts.items():
        mean, variance = normaliser.moments.get(key, (None, None))
        parts.append(Part(key, size + (1 if timed and key == MAIN else 0), mean, variance))
    limit = spaces.time_limit_steps if timed else None
    return Pipeline(tuple(parts), spaces.is_dict, limit, normaliser.clip, normaliser.epsilon)


def _check_sizes(environment: str, spaces: Spaces, sizes: tuple[int, ...], timed: bool) -> None:
    given = sum(spaces.parts.values()) + timed
    if given != sizes[0]:
        hint = ""
        if sizes[0] == given + 1 and not timed:
            hint = " If it was trained in a TimeFeatureWrapper, say --time-feature."
        raise UsageError(
            f"its policy takes {sizes[0]} features, {environment} gives {given}"
            f"{' with the time feature' if timed else ''}: another environment or wrapper.{hint}"
        )
    if len(spaces.low) != sizes[-1]:
        raise UsageError(f"its policy gives {sizes[-1]} actions, {environment} takes {len(spaces.low)}.")
