"""An agent's pipeline and network in the helper's form."""

from __future__ import annotations

import numpy as np

from drs_core.accelerator.library import Policy, Unavailable, float64, int32, pointer
from drs_core.agent import Agent
from drs_core.policy import Float32

ACTIVATIONS = ("tanh", "relu", "elu", "leaky_relu", "silu")
"""In the order of the enumeration in policy.h."""
MAX_LAYERS = 64


class PolicyData:
    """The structure `Policy` of an agent, and the arrays that it points to."""

    def __init__(self, agent: Agent) -> None:
        """Prepare buffers; `load` fills in theta.

        Raises:
            Unavailable: the helper has not such a network or pipeline.
        """
        network, pipeline = agent.network, agent.pipeline
        if network.activation not in ACTIVATIONS:
            raise Unavailable(f"it knows the activations {', '.join(ACTIVATIONS)}, not {network.activation}")
        if len(network.shapes) > MAX_LAYERS or len(pipeline.parts) != 1:
            raise Unavailable(f"it takes one observation part and {MAX_LAYERS} layers at most")
        part, timed = pipeline.parts[0], pipeline.time_limit_steps is not None
        if part.mean is not None and part.variance is not None:
            mean, scale = float64(part.mean), np.sqrt(part.variance + pipeline.epsilon)
            clip = np.full(part.size, pipeline.clip)
        else:
            mean, scale, clip = np.zeros(part.size), np.ones(part.size), np.full(part.size, np.inf)
        self.n_features, self._network = part.size, network
        self._parameters = np.zeros(network.parameters, dtype=np.float32)
        self._arrays = {
            "mean": mean,
            "scale": scale,
            "clip": clip,
            "sizes": int32(network.sizes),
            "parameters": self._parameters,
            "low": float64(agent.low),
            "high": float64(agent.high),
            "scratch": np.zeros(2 * max(network.sizes)),
        }
        self.structure = Policy(
            n_features=part.size,
            time_index=part.size - 1 if timed else -1,
            time_limit=pipeline.time_limit_steps or 0,
            n_layers=len(network.shapes),
            activation=ACTIVATIONS.index(network.activation),
            squashed=network.output == "tanh",
            mean_clip=network.mean_clip or 0.0,
            **{name: pointer(array) for name, array in self._arrays.items()},
        )

    def load(self, theta: Float32) -> None:
        """Use theta (d,) float32 from now on."""
        start = 0
        for weight, bias in self._network.layers(theta):
            outputs, inputs = weight.shape
            middle, stop = start + weight.size, start + weight.size + outputs
            # an input's weights side by side: see `layer` in policy.h
            self._parameters[start:middle].reshape(inputs, outputs)[:] = weight.T
            self._parameters[middle:stop] = bias
            start = stop
