"""What a Stable-Baselines3 zip says, without building what it stores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drs_core.errors import UsageError
from drs_core.files import parse_json
from drs_core.importing.archive import Archive
from drs_core.importing.weights import Tensor, read_weights

MAX_ZIP_BYTES = 512 * 2**20


@dataclass(frozen=True)
class Saved:
    """The parts of a saved model that describe its deterministic policy.

    Attributes:
        data: the JSON member ``data``; its serialized (pickled) fields are never decoded.
        tensors: the policy's tensors.
        version: version of Stable-Baselines3 that saved it, or ``unknown``.
    """

    data: Mapping[str, Any]
    tensors: Mapping[str, Tensor]
    version: str

    @property
    def policy_kwargs(self) -> Mapping[str, Any]:
        """Keyword arguments of the policy as texts and plain values."""
        kwargs = self.data.get("policy_kwargs")
        return kwargs if isinstance(kwargs, dict) else {}

    @property
    def gsde(self) -> bool:
        """Whether it was trained with generalised state-dependent exploration."""
        return self.data.get("use_sde") is True


def read_zip(content: bytes, name: str) -> Saved:
    """Read a saved model.

    Raises:
        UsageError: it is not one, or is for discrete actions.
    """
    archive = Archive(content, name)
    data = parse_json(archive.read("data"), f"the member 'data' of {name}")
    if not isinstance(data, dict):
        raise UsageError(f"the member 'data' of {name} is not a JSON object.")
    actions = data.get("action_space")
    kind = str(actions.get(":type:", ""))[:80] if isinstance(actions, dict) else ""
    if "Discrete" in kind or "MultiBinary" in kind:
        raise UsageError(f"{name} has the actions {kind}; only continuous actions (Box) can be tuned.")
    version = "unknown"
    if "_stable_baselines3_version" in archive.names:
        version = archive.read("_stable_baselines3_version")[:40].decode("ascii", "replace").strip()
    return Saved(data, read_weights(archive.read("policy.pth"), f"policy.pth in {name}"), version)
