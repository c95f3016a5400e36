"""What needs no cluster: batches and settings."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.ray_rollouts.batches import TASK_S, BatchSize
from drs_core.ray_rollouts.config import RayConfig, read_ray_config
from drs_core.ray_rollouts.worker import run_batch
from drs_core.rollouts import InProcess, Task
from tests.conftest import drs, make_agent, refused


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


def test_a_batch_is_what_one_process_gives(tmp_path: Path) -> None:
    agent, tasks = make_agent(), [Task(seed) for seed in range(3)]
    answer = run_batch(agent, agent.digest(), "python", agent.theta, tasks)
    assert answer.error is None and answer.duration_s > 0.0
    assert list(answer.episodes) == InProcess(agent).run(agent.theta, tasks)
    wrong = run_batch(agent, agent.digest(), "python", agent.theta[:-1], tasks)
    assert wrong.error is not None and not wrong.episodes


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
