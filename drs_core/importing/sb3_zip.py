"""What a Stable-Baselines3 zip says, without building what it stores."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drs_core.errors import UsageError, shown
from drs_core.importing.archive import Archive
from drs_core.importing.weights import Tensor, read_weights

MAX_ZIP_BYTES = 512 * 2**20
MAX_DATA_BYTES = 16 * 2**20
_POLICY = re.compile(r"stable_baselines3\.(common|a2c|ppo|ddpg|td3|sac)\.policies|sb3_contrib\.tqc\.policies")


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
    try:
        # Stable-Baselines3 writes Infinity, which strict JSON does not know
        data = json.loads(archive.read("data", MAX_DATA_BYTES))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"the member 'data' of {name} is not valid JSON: {str(error)[:200]}.") from error
    if not isinstance(data, dict):
        raise UsageError(f"the member 'data' of {name} is not a JSON object.")
    _refuse_foreign_policy(data, name)
    actions = data.get("action_space")
    kind = shown(actions.get(":type:", "")) if isinstance(actions, dict) else ""
    if "Discrete" in kind or "MultiBinary" in kind:
        raise UsageError(f"{name} has the actions {kind}; only continuous actions (Box) can be tuned.")
    version = "unknown"
    if "_stable_baselines3_version" in archive.names:
        version = archive.read("_stable_baselines3_version")[:40].decode("ascii", "replace").strip()
    return Saved(data, read_weights(archive.read("policy.pth"), f"policy.pth in {name}"), version)


def _refuse_foreign_policy(data: Mapping[str, Any], name: str) -> None:
    """A class of one's own may compute anything from the same weights."""
    described = data.get("policy_class")
    module = described.get("__module__") if isinstance(described, dict) else None
    if isinstance(module, str) and not _POLICY.fullmatch(module):
        raise UsageError(
            f"{name} has a policy class of {shown(module)}; "
            "only the MLP policies of A2C, PPO, DDPG, TD3, SAC and TQC are known."
        )
