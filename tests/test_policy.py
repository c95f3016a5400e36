import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.policy import ACTIVATIONS, Network, Policy

sizes = st.lists(st.integers(1, 7), min_size=2, max_size=4).map(tuple)


@settings(max_examples=60, deadline=None)
@given(sizes, st.sampled_from(sorted(ACTIVATIONS)), st.sampled_from(["clip", "tanh"]), st.integers(0, 2**32 - 1))
def test_actions_are_finite_and_within_the_bounds(sizes, activation, output, seed):
    rng = np.random.default_rng(seed)
    network = Network(sizes, activation, output, mean_clip=2.0)
    low = rng.uniform(-3, -0.1, sizes[-1]).astype(np.float32)
    high = rng.uniform(0.1, 3, sizes[-1]).astype(np.float32)
    policy = Policy(network, low, high)
    policy.load((rng.standard_normal(network.parameters) * 10 ** rng.uniform(-3, 3)).astype(np.float32))
    action = policy.act((rng.standard_normal(sizes[0]) * 100).astype(np.float32))
    assert action.dtype == np.float32 and np.isfinite(action).all()
    assert (action >= low).all() and (action <= high).all()


@settings(max_examples=60, deadline=None)
@given(sizes, st.sampled_from(sorted(ACTIVATIONS)), st.sampled_from(["clip", "tanh"]), st.integers(0, 2**32 - 1))
def test_an_action_has_the_bits_of_the_formula_wherever_it_is_written(sizes, activation, output, seed):
    rng = np.random.default_rng(seed)
    network = Network(sizes, activation, output, mean_clip=2.0)
    high = rng.uniform(0.1, 3, sizes[-1]).astype(np.float32)
    policy = Policy(network, -high, high)
    theta = rng.standard_normal(network.parameters).astype(np.float32)
    policy.load(theta)
    rows = np.full((2, sizes[-1]), np.nan, np.float32)
    for features in rng.standard_normal((3, sizes[0])).astype(np.float32):
        x = features.astype(np.float64)
        layers = network.layers(theta.astype(np.float64))
        for weight, bias in layers[:-1]:
            x = np.einsum("ij,j->i", weight, x) + bias
            ACTIVATIONS[activation](x)
        x, bound = np.einsum("ij,j->i", layers[-1][0], x) + layers[-1][1], high.astype(np.float64)
        if output == "tanh":
            x = (np.tanh(np.clip(x, -2.0, 2.0)) + 1.0) * (0.5 * (bound + bound)) - bound
        expected = np.clip(x, -bound, bound).astype(np.float32)
        assert policy.act(features).tobytes() == expected.tobytes()
        assert policy.act(features, rows[1]) is not None and rows[1].tobytes() == expected.tobytes()
    assert np.isnan(rows[0]).all()


@pytest.mark.parametrize("activation", sorted(ACTIVATIONS))
def test_the_forward_pass_equals_torch(activation):
    torch = pytest.importorskip("torch")
    modules = {"tanh": "Tanh", "relu": "ReLU", "elu": "ELU", "leaky_relu": "LeakyReLU", "silu": "SiLU"}
    torch.manual_seed(0)
    net = torch.nn.Sequential(
        torch.nn.Linear(5, 9), getattr(torch.nn, modules[activation])(), torch.nn.Linear(9, 3)
    ).double()
    network = Network((5, 9, 3), activation, "tanh")
    policy = Policy(network, -np.ones(3, np.float32), np.ones(3, np.float32))
    theta = np.concatenate([p.detach().numpy().ravel() for p in net.parameters()]).astype(np.float32)
    policy.load(theta)
    with torch.no_grad():
        torch.nn.utils.vector_to_parameters(torch.tensor(theta.astype(np.float64)), net.parameters())
        x = np.linspace(-3, 3, 5).astype(np.float32)
        expected = torch.tanh(net(torch.tensor(x.astype(np.float64)))).numpy()
    np.testing.assert_allclose(policy.act(x), expected, atol=1e-7)


def test_last_layer_is_the_end_of_theta():
    network = Network((4, 8, 2), "relu", "clip")
    assert network.parameters == 4 * 8 + 8 + 8 * 2 + 2
    assert network.parameters - network.last_layer_start == 8 * 2 + 2
    weight, bias = network.layers(np.arange(network.parameters))[-1]
    assert weight[0, 0] == network.last_layer_start and bias[-1] == network.parameters - 1


@pytest.mark.parametrize(
    "arguments",
    [((3,), "relu", "clip"), ((3, 0), "relu", "clip"), ((3, 2), "gelu", "clip"), ((3, 2), "relu", "softmax"),
     ((65536, 65536), "relu", "clip"), ((3, 2), "relu", "tanh", float("nan"))],
)  # fmt: skip
def test_networks_that_cannot_be_are_refused(arguments):
    with pytest.raises(UsageError):
        Network(*arguments)


_PROGRAM = """
import hashlib, numpy as np
from drs_core.policy import Network, Policy
network = Network((27, 256, 256, 6), "tanh", "tanh")
policy = Policy(network, -np.ones(6, np.float32), np.ones(6, np.float32))
rng = np.random.default_rng(1)
policy.load((0.1 * rng.standard_normal(network.parameters)).astype(np.float32))
digest = hashlib.sha256()
for _ in range(500):
    digest.update(policy.act(rng.standard_normal(27).astype(np.float32)).tobytes())
print(digest.hexdigest())
"""


def test_actions_do_not_depend_on_the_blas_kernel_or_the_number_of_threads():
    settings = [
        {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"},
        {"OPENBLAS_CORETYPE": "Prescott", "OPENBLAS_NUM_THREADS": "2"},
        {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL"},
    ]
    digests = {
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", _PROGRAM],
            env={**os.environ, **setting}, capture_output=True, text=True, check=True,
        ).stdout
        for setting in settings
    }  # fmt: skip
    assert len(digests) == 1
