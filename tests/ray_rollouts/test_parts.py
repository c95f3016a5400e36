"""What needs no cluster: batches and settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.ray_rollouts import worker
from drs_core.ray_rollouts.batches import TASK_S, BatchSize
from drs_core.ray_rollouts.config import RayConfig, read_ray_config
from drs_core.ray_rollouts.messages import Batch
from drs_core.ray_rollouts.worker import run_batch
from drs_core.rollouts import InProcess, Task
from drs_core.rollouts.proof import Proof
from drs_core.scope import Scope
from drs_core.search import Perturbation
from tests.conftest import drs, make_agent, refused
from tests.rollouts.test_not_finite import poison


@pytest.fixture(autouse=True)
def simulators() -> Iterator[None]:
    """What a test made in this process is freed."""
    yield
    worker._close()


@given(
    waiting=st.integers(0, 10_000),
    slots=st.integers(0, 5000),
    durations=st.lists(st.tuples(st.integers(1, 100), st.floats(0.0, 1e4)), max_size=5),
)
def test_batches_are_never_empty_nor_larger_than_what_waits(
    waiting: int, slots: int, durations: list[tuple[int, float]]
) -> None:
    size = BatchSize()
    for episodes, duration_s in durations:
        size.learn(episodes, duration_s)
    found = size.next(waiting, slots)
    assert (found >= 1) == (waiting >= 1) and found <= waiting


def test_a_task_takes_about_half_a_second_and_the_last_ones_less() -> None:
    size = BatchSize()
    assert size.next(1000, 4) == 2
    for _ in range(50):
        size.learn(2, 0.02)
    assert size.next(1000, 4) == pytest.approx(TASK_S / 0.01, abs=1)
    assert size.next(40, 4) == 6 and size.next(3, 4) == 2 and size.next(1, 4) == 1
    for _ in range(50):
        size.learn(1, 5.0)
    # an episode longer than that still brings its antithetic partner
    assert size.next(1000, 4) == 2


def batch(agent: Agent, tasks: list[Task], proof: Proof | None = None) -> Batch:
    return Batch(agent.digest(), "python", proof or Proof.of(agent.theta), tasks)


def test_a_batch_crosses_as_strings_and_numbers() -> None:
    agent, scope = make_agent(), Scope(3, 2)
    sides = [
        Task(7, frozenset({"dimension", "motion"}), Perturbation(2**62, 5, 1, sign, 0.1, scope)) for sign in (1, -1)
    ]
    whole = batch(agent, [Task(2**31), *sides])
    plain = whole.plain()
    assert Batch.of(plain) == whole
    kinds, left = set[type](), [plain]
    while left:
        kinds.update(type(value) for value in left)
        left = [value for group in left if isinstance(group, (tuple, list)) for value in group]
    assert kinds == {tuple, list, str, int, float, type(None)}


def test_a_batch_is_what_one_process_gives() -> None:
    agent, tasks = make_agent(), [Task(seed) for seed in range(3)]
    answer = run_batch(batch(agent, tasks), lambda: agent, agent.theta)
    assert answer.error is None and answer.duration_s > 0.0
    assert list(answer.episodes) == InProcess(agent).run(agent.theta, tasks)
    short = agent.theta[:-1]
    wrong = run_batch(batch(agent, tasks, Proof.of(short)), lambda: agent, short)
    assert wrong.error is not None and "Traceback" in wrong.error and not wrong.episodes


@pytest.mark.parametrize(
    ("changed", "words"), [({"theta": "0"}, "it changed on its way"), ({"candidate": "0"}, "draws other perturbations")]
)
def test_a_worker_that_makes_other_candidates_takes_no_part(changed: dict[str, str], words: str) -> None:
    agent = make_agent()
    proof = replace(Proof.of(agent.theta), versions="drs 9 with numpy 9", **changed)
    answer = run_batch(batch(agent, [Task(0)], proof), lambda: agent, agent.theta)
    assert answer.exit_status == 1 and words in str(answer.error) and not answer.episodes
    if "candidate" in changed:
        assert f"numpy {np.__version__} there" in str(answer.error) and "drs 9 with numpy 9" in str(answer.error)


def test_a_worker_looks_at_each_theta_once(monkeypatch: pytest.MonkeyPatch) -> None:
    agent, looked = make_agent(seed=5), list[int]()
    proof, difference = Proof.of(agent.theta), Proof.difference
    monkeypatch.setattr(Proof, "difference", lambda *both: looked.append(1) or difference(*both))
    for _ in range(3):
        assert run_batch(batch(agent, [Task(0)], proof), lambda: agent, agent.theta).error is None
    assert len(looked) == 1


def test_where_an_episode_fails_the_worker_makes_its_simulator_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    agent, tasks = make_agent("PandaReach-v3"), [Task(1), Task(2)]
    expected = run_batch(batch(agent, tasks), lambda: agent, agent.theta).episodes
    with poison(monkeypatch):
        raise RuntimeError(run_batch(batch(agent, tasks), lambda: agent, agent.theta).error)
    answer = run_batch(batch(agent, tasks), lambda: agent, agent.theta)
    assert len(expected) == 2 and answer.episodes == expected


def test_settings_are_read_and_checked(tmp_path: Path) -> None:
    path = tmp_path / "ray.yaml"
    path.write_text("address: auto\ncpus_per_task: 0.5\nresources: {simulator: 1}\nruntime_env: {env_vars: {A: b}}\n")
    config = read_ray_config(path)
    assert config == RayConfig(
        address="auto", cpus_per_task=0.5, resources={"simulator": 1}, runtime_env={"env_vars": {"A": "b"}}
    )
    assert read_ray_config(None) == RayConfig()
    for text, words in {
        "adress: auto": "known are address",
        "cpus: 0": "cpus is 0",
        "cpus_per_task: .nan": "cpus_per_task is nan",
        "resources: [1]": "resources is",
        "resources: {gpu: -1}": "resources: gpu is -1",
        "address: ''": "address is ''",
    }.items():
        path.write_text(text)
        with pytest.raises(UsageError, match=words):
            read_ray_config(path)


def test_the_command_line_says_what_is_wrong(tmp_path: Path) -> None:
    settings = tmp_path / "ray.yaml"
    settings.write_text("address: auto\n")
    out = tmp_path / "run"
    refused(drs("tune", "panda_reach", "--output", out, "--rollouts", "cloud"), "choose local or ray")
    refused(drs("tune", "panda_reach", "--output", out, "--ray", settings), "is for --rollouts ray")
    refused(
        drs("tune", "panda_reach", "--output", out, "--rollouts", "ray", "--ray", settings, "--workers", 2),
        "names the cluster auto",
    )
    refused(drs("tune", "panda_reach", "--output", out, "--rollouts", "ray", "--workers", 0), "workers is 0")
    assert not out.exists()
