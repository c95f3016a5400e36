"""Shared paths, a tiny agent, and the command line as a process."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drs_core.agent import Agent
from drs_core.environments import describe
from drs_core.observation import Part, Pipeline
from drs_core.policy import Network

SHARED = Path(__file__).resolve().parents[2] / "shared"


ANY_PACE = (
    "backend", "broken_off", "broken_simulators", "budget", "evaluate", "failing_run", "graph_command",
    "killed_nodes", "names", "pause", "rollouts", "transitions", "two_tuners", "unknown_parameters", "wild",
)  # fmt: skip
"""Of the tests of nodes, those whose nodes wait for each other and not for the clock: two of them at a time."""


def pytest_configure() -> None:
    """What a script starts with `&` ignores Ctrl-C, and so would every command of a test."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Other nodes run in real time: their tests run alone."""
    for item in items:
        path = Path(item.path)
        if path.parent.name in ("ros", "network"):
            any_pace = path.parent.name == "ros" and path.stem.removeprefix("test_") in ANY_PACE
            item.add_marker(pytest.mark.nodes if any_pace else pytest.mark.alone)


@pytest.fixture(scope="session")
def shared() -> Path:
    if not SHARED.is_dir():
        pytest.skip(f"the shared agents and golden files are not at {SHARED}")
    return SHARED


def make_agent(environment: str = "MountainCarContinuous-v0", hidden: tuple[int, ...] = (8,), seed: int = 0) -> Agent:
    """A random agent of any environment, with a normaliser."""
    spaces, rng = describe(environment), np.random.default_rng(seed)
    parts = tuple(
        Part(key, size, rng.normal(size=size), rng.uniform(0.5, 2.0, size)) for key, size in spaces.parts.items()
    )
    pipeline = Pipeline(parts, spaces.is_dict)
    network = Network((pipeline.size, *hidden, len(spaces.low)), "tanh", "clip")
    theta = (0.5 * rng.standard_normal(network.parameters)).astype(np.float32)
    return Agent(environment, pipeline, network, spaces.low, spaces.high, theta, source={"algorithm": "none"})


@pytest.fixture
def agent_file(tmp_path: Path) -> Path:
    """A file of such an agent."""
    path = tmp_path / "agent.safetensors"
    make_agent().save(path)
    return path


@pytest.fixture
def agent() -> Agent:
    return make_agent()


def drs(*arguments: object, timeout: float = 120, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command line as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "drs_core.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=timeout,
        env={**os.environ, **environment},
    )


def refused(result: subprocess.CompletedProcess[str], *words: str) -> None:
    """A user's mistake: status 1 or 2, a short message with these words, no traceback, nothing on stdout."""
    assert result.returncode in (1, 2), result
    assert "Traceback" not in result.stderr, result.stderr
    assert result.stdout == ""
    assert 0 < len(result.stderr) < 700, result.stderr
    for word in words:
        assert word in " ".join(result.stderr.split()), result.stderr
