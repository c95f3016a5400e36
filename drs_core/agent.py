"""The agent: policy, observation pipeline, environment and provenance; one safetensors file.

Layout of the file (format 1): tensors ``policy.<layer>.weight`` (outputs, inputs) and
``policy.<layer>.bias`` float32, ``action.low`` and ``action.high`` float32, for every normalised
part ``observation.<key>.mean`` and ``.variance`` float64; all else is JSON in the header's metadata
under ``drs``. Nothing in it is ever unpickled.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save as to_safetensors

from drs_core.errors import UsageError, shown
from drs_core.files import parse_json, write_atomically
from drs_core.observation import Assembler, Part, Pipeline
from drs_core.policy import Network, Policy

FORMAT = 1
MAX_FILE_BYTES = 256 * 2**20
SUFFIX = ".safetensors"

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Agent:
    """A policy with all that is needed to run it.

    Attributes:
        environment: gymnasium id of today.
        pipeline: observation -> policy input.
        network: architecture.
        low, high: (n_actions,) float32, action bounds.
        theta: (d,) float32, every parameter that influences the deterministic action.
        source: where it comes from: plain strings and numbers, with the sha256 of the file.
        tuning: one mapping for each tuning run that made it, oldest first.
    """

    environment: str
    pipeline: Pipeline
    network: Network
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    theta: NDArray[np.float32]
    source: Mapping[str, Any] = field(default_factory=dict)
    tuning: tuple[Mapping[str, Any], ...] = ()

    def __post_init__(self) -> None:
        """Raise UsageError where sizes do not fit each other or a number is not finite."""
        d, n_actions = self.network.parameters, self.network.sizes[-1]
        if self.theta.shape != (d,) or self.theta.dtype != np.float32:
            raise UsageError(f"theta is {self.theta.dtype} {self.theta.shape}; the network needs float32 ({d},).")
        if not np.isfinite(self.theta).all():
            raise UsageError(f"{int((~np.isfinite(self.theta)).sum())} of the policy's {d} weights are not finite.")
        if self.pipeline.size != self.network.sizes[0]:
            raise UsageError(
                f"The observation has {self.pipeline.size} features, the policy takes {self.network.sizes[0]}."
            )
        for name, bound in (("low", self.low), ("high", self.high)):
            if bound.shape != (n_actions,) or not np.isfinite(bound).all():
                raise UsageError(f"Action bound {name} {bound} must be {n_actions} finite numbers.")
        if not (self.low < self.high).all():
            raise UsageError(f"Action bounds {self.low} must lie below {self.high}.")

    def policy(self) -> Policy:
        """A new policy with this theta loaded."""
        policy = Policy(self.network, self.low, self.high)
        policy.load(self.theta)
        return policy

    def assembler(self) -> Assembler:
        """A new assembler of this pipeline."""
        return Assembler(self.pipeline)

    def with_theta(self, theta: NDArray[np.float32], tuning: tuple[Mapping[str, Any], ...]) -> Agent:
        """The same agent with another theta (d,) and tuning history."""
        return dataclasses.replace(self, theta=theta, tuning=tuning)

    def digest(self) -> str:
        """Sha256 over everything that decides what the agent does."""
        tensors, metadata = _pack(self)
        behaviour = {key: metadata[key] for key in ("environment", "observation", "network")}
        digest = hashlib.sha256(json.dumps(behaviour, sort_keys=True).encode())
        for name in sorted(tensors):
            digest.update(name.encode() + tensors[name].tobytes())
        return digest.hexdigest()

    def to_bytes(self) -> bytes:
        """The agent file's content; the same agent gives the same bytes."""
        tensors, metadata = _pack(self)
        return to_safetensors(tensors, {"drs": json.dumps(metadata, sort_keys=True, allow_nan=False)})

    def save(self, path: Path) -> None:
        """Write the agent file atomically."""
        write_atomically(path, self.to_bytes())


def load(path: Path) -> Agent:
    """Read an agent file.

    Raises:
        UsageError: it is not one, or a shape, range or number in it is wrong.
    """
    try:
        if path.is_dir():
            raise UsageError(f"{path} is a folder and no agent file; name the file in it.")
        if not path.is_file():
            raise UsageError(f"There is no agent file {path}; check the path.")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise UsageError(f"{path} is larger than {MAX_FILE_BYTES} bytes, the most for an agent file.")
        with safe_open(path, framework="numpy") as file:
            text = (file.metadata() or {}).get("drs")
            if text is None:
                raise UsageError(f"{path} is a safetensors file, but no drs agent; make one with: drs import.")
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except (SafetensorError, OSError, TypeError, AttributeError, ValueError) as error:
        # the latter three: number formats that numpy does not have
        raise UsageError(f"{path} is not an agent file: {error}.") from error
    try:
        return _unpack(parse_json(text, "its metadata"), tensors)
    except UsageError as error:
        raise UsageError(f"{path} is not a usable agent file: {error}") from error


def _pack(agent: Agent) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    tensors: dict[str, NDArray[Any]] = {"action.low": agent.low, "action.high": agent.high}
    for index, (weight, bias) in enumerate(agent.network.layers(agent.theta)):
        tensors[f"policy.{index}.weight"] = np.ascontiguousarray(weight)
        tensors[f"policy.{index}.bias"] = np.ascontiguousarray(bias)
    parts = []
    for part in agent.pipeline.parts:
        parts.append({"key": part.key, "size": part.size, "normalised": part.mean is not None})
        if part.mean is not None and part.variance is not None:
            tensors[f"observation.{part.key}.mean"] = part.mean
            tensors[f"observation.{part.key}.variance"] = part.variance
    metadata = {
        "format": FORMAT,
        "environment": agent.environment,
        "observation": {
            "parts": parts,
            "is_dict": agent.pipeline.is_dict,
            "time_limit_steps": agent.pipeline.time_limit_steps,
            "clip": agent.pipeline.clip,
            "epsilon": agent.pipeline.epsilon,
        },
        "network": {
            "sizes": list(agent.network.sizes),
            "activation": agent.network.activation,
            "output": agent.network.output,
            "mean_clip": agent.network.mean_clip,
        },
        "source": dict(agent.source),
        "tuning": [dict(record) for record in agent.tuning],
    }
    return tensors, metadata


def _unpack(metadata: Any, tensors: dict[str, NDArray[Any]]) -> Agent:
    version = _get(metadata, "format", int)
    if version != FORMAT:
        raise UsageError(f"format {version} is not known, only {FORMAT}; update drs.")
    net, seen = _get(metadata, "network", dict), _get(metadata, "observation", dict)
    network = Network(
        sizes=tuple(_check(size, "network.sizes", int) for size in _get(net, "sizes", list)),
        activation=_get(net, "activation", str),
        output=_get(net, "output", str),
        mean_clip=None if net.get("mean_clip") is None else _float(net, "mean_clip"),
    )
    parts = tuple(_part(_check(part, "observation.parts", dict), tensors) for part in _get(seen, "parts", list))
    limit = seen.get("time_limit_steps")
    pipeline = Pipeline(
        parts=parts,
        is_dict=_get(seen, "is_dict", bool),
        time_limit_steps=None if limit is None else _get(seen, "time_limit_steps", int),
        clip=_float(seen, "clip"),
        epsilon=_float(seen, "epsilon"),
    )
    flat = []
    for index, (rows, columns) in enumerate(network.shapes):
        flat.append(_tensor(tensors, f"policy.{index}.weight", np.float32, (rows, columns)).ravel())
        flat.append(_tensor(tensors, f"policy.{index}.bias", np.float32, (rows,)))
    agent = Agent(
        environment=_get(metadata, "environment", str),
        pipeline=pipeline,
        network=network,
        low=_tensor(tensors, "action.low", np.float32, (network.sizes[-1],)),
        high=_tensor(tensors, "action.high", np.float32, (network.sizes[-1],)),
        theta=np.concatenate(flat),
        source=_get(metadata, "source", dict),
        tuning=tuple(_check(record, "tuning", dict) for record in _get(metadata, "tuning", list)),
    )
    if tensors:
        raise UsageError(f"it holds tensors that nothing uses: {', '.join(sorted(tensors))[:200]}.")
    return agent


def _part(described: dict[str, Any], tensors: dict[str, NDArray[Any]]) -> Part:
    key, size = _get(described, "key", str), _get(described, "size", int)
    if not _get(described, "normalised", bool):
        return Part(key, size)
    mean, variance = (
        _tensor(tensors, f"observation.{key}.{name}", np.float64, (size,)) for name in ("mean", "variance")
    )
    return Part(key, size, mean, variance)


def _tensor(tensors: dict[str, NDArray[Any]], name: str, dtype: type, shape: tuple[int, ...]) -> NDArray[Any]:
    tensor = tensors.pop(name, None)
    if tensor is None:
        raise UsageError(f"the tensor {name} is missing.")
    if tensor.dtype != dtype or tensor.shape != shape:
        raise UsageError(f"the tensor {name} is {tensor.dtype} {tensor.shape}, not {np.dtype(dtype)} {shape}.")
    return tensor


def _get(mapping: Any, key: str, kind: type[T]) -> T:
    if not isinstance(mapping, dict) or key not in mapping:
        raise UsageError(f"the metadata key {key!r} is missing.")
    return _check(mapping[key], key, kind)


def _float(mapping: Any, key: str) -> float:
    try:
        return float(_get(mapping, key, float))
    except OverflowError as error:
        raise UsageError(f"the metadata key {key!r} is out of range.") from error


def _check(value: Any, key: str, kind: type[T]) -> T:
    allowed = (int, float) if kind is float else kind
    if not isinstance(value, allowed) or (isinstance(value, bool) and kind is not bool):
        raise UsageError(f"the metadata key {key!r} is {shown(value)}, not of type {kind.__name__}.")
    return value  # type: ignore[return-value]
