"""From the tensors of a Stable-Baselines3 policy to the network that acts, and its theta.

Which tensors act, by algorithm (Stable-Baselines3 1.0 to 2.9):
A2C, PPO: ``mlp_extractor.[shared_net.N, ]policy_net.N``, ``action_net``; clipped to the bounds.
DDPG, TD3: ``actor.mu.N``; tanh. SAC, TQC: ``actor.latent_pi.N``, ``actor.mu``; tanh; with gSDE the
last layer is ``actor.mu.0`` and the mean is clipped before the tanh.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError, shown
from drs_core.importing.weights import Tensor
from drs_core.policy import Network

ON_POLICY, DETERMINISTIC, SQUASHED = ("a2c", "ppo"), ("ddpg", "td3"), ("sac", "tqc")
ALGORITHMS = (*ON_POLICY, *DETERMINISTIC, *SQUASHED)
_ACTIVATIONS = {"ReLU": "relu", "Tanh": "tanh", "ELU": "elu", "LeakyReLU": "leaky_relu", "SiLU": "silu"}
_GSDE_MEAN_CLIP = 2.0

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


def build(
    algorithm: str, tensors: Mapping[str, Tensor], policy_kwargs: Mapping[str, Any], gsde: bool
) -> tuple[Network, NDArray[np.float32]]:
    """The network and theta (d,) float32 of the deterministic policy.

    Raises:
        UsageError: the policy is of a kind that cannot be run here.
    """
    _refuse_other_kinds(tensors, policy_kwargs)
    squash, mean_clip = True, None
    if algorithm in ON_POLICY:
        prefixes = ["mlp_extractor.shared_net", "mlp_extractor.policy_net"]
        hidden = [layer for prefix in prefixes for layer in _numbered(tensors, prefix)]
        last = _layer(tensors, "action_net")
        squash = gsde and policy_kwargs.get("squash_output") is True
    elif algorithm in DETERMINISTIC:
        hidden = _numbered(tensors, "actor.mu")
        if not hidden:
            raise UsageError(f"the file has no actor of {algorithm}: the weights 'actor.mu.0.weight' are missing.")
        last = hidden.pop()
    else:
        hidden = _numbered(tensors, "actor.latent_pi")
        if "actor.mu.0.weight" in tensors:
            last, mean_clip = _layer(tensors, "actor.mu.0"), _mean_clip(policy_kwargs)
        else:
            last = _layer(tensors, "actor.mu")
    layers = [*hidden, last]
    for (below, _), (above, _) in pairwise(layers):
        if below.shape[0] != above.shape[1]:
            raise UsageError(f"the layers {below.shape} and {above.shape} of the policy do not fit each other.")
    network = Network(
        sizes=(layers[0][0].shape[1], *(weight.shape[0] for weight, _ in layers)),
        activation=_activation(algorithm, policy_kwargs),
        output="tanh" if squash else "clip",
        mean_clip=mean_clip,
    )
    return network, np.concatenate([values.ravel() for layer in layers for values in layer])


def infer_algorithm(tensors: Mapping[str, Tensor], data: Mapping[str, Any]) -> str:
    """The algorithm of a zip that nobody named, from what only its saver writes."""
    if "action_net.weight" in tensors:
        if "cg_max_steps" in data:
            return "trpo"
        return "ppo" if "clip_range" in data else "a2c"
    if "actor.log_std.weight" in tensors or "actor.log_std" in tensors:
        return "tqc" if "top_quantiles_to_drop_per_net" in data else "sac"
    if "actor.mu.0.weight" in tensors:
        return "td3" if any(name.startswith("critic.qf1.") for name in tensors) else "ddpg"
    return "unknown"


def _refuse_other_kinds(tensors: Mapping[str, Tensor], policy_kwargs: Mapping[str, Any]) -> None:
    for name in tensors:
        if "lstm" in name:
            raise UsageError("it is a recurrent policy; only feed-forward (MLP) policies can be tuned.")
        if re.match(r"(actor\.|pi_)?features_extractor\..", name):
            kind = "a CNN" if "cnn" in name else "a features extractor with weights of its own"
            raise UsageError(f"its policy has {kind} ({name[:60]}); only MLP policies on vectors can be tuned.")
    extractor = str(policy_kwargs.get("features_extractor_class", ""))[:200]
    if extractor and not re.search(r"FlattenExtractor|CombinedExtractor", extractor):
        raise UsageError(f"its policy has the features extractor {extractor[:80]}; only MLP policies can be tuned.")


def _numbered(tensors: Mapping[str, Tensor], prefix: str) -> list[Layer]:
    pattern = re.compile(re.escape(prefix) + r"\.(\d{1,4})\.(weight|bias)")
    matches = [match for name in tensors if (match := pattern.fullmatch(name))]
    return [_layer(tensors, f"{prefix}.{index}") for index in sorted({int(match[1]) for match in matches})]


def _layer(tensors: Mapping[str, Tensor], name: str) -> Layer:
    try:
        weight, bias = tensors[f"{name}.weight"], tensors[f"{name}.bias"]
    except KeyError as error:
        raise UsageError(f"the weights {error.args[0]!r} are missing.") from error
    if len(weight.shape) != 2 or bias.shape != weight.shape[:1]:
        raise UsageError(f"{name} has weights {weight.shape} and biases {bias.shape}: no linear layer.")
    return weight.array(), bias.array()


def _activation(algorithm: str, policy_kwargs: Mapping[str, Any]) -> str:
    text = str(policy_kwargs.get("activation_fn", ""))[:200]
    if not text:
        return "tanh" if algorithm in ON_POLICY else "relu"
    match = re.search(r"(\w+)'?>?$", text)
    if match is None or match[1] not in _ACTIVATIONS:
        raise UsageError(f"its activation {text[:80]} is not known; known: {', '.join(_ACTIVATIONS)}.")
    return _ACTIVATIONS[match[1]]


def _mean_clip(policy_kwargs: Mapping[str, Any]) -> float:
    value = policy_kwargs.get("clip_mean", _GSDE_MEAN_CLIP)
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise UsageError(f"its clip_mean {shown(value)} is not a number.")
    return float(min(value, 1e9))
