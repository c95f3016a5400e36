"""A Ray cluster on this machine: the bits of one process, whatever is lost on the way."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from drs_core import __version__
from drs_core.errors import DrsError
from drs_core.ray_rollouts import RayConfig, RayRollouts
from drs_core.rollouts import InProcess, Task
from drs_core.search import Perturbation
from tests.conftest import drs, make_agent, refused

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install -c constraints.txt -e '.[ray]'")

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.timeout(240)
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")


def tasks(count: int) -> list[Task]:
    return [Task(i // 2, frozenset(), Perturbation(0, 0, i // 2, 1 - 2 * (i % 2), 0.05)) for i in range(count)]


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    """Two machines as far as Ray can tell; the second one may be lost."""
    from ray.cluster_utils import Cluster

    # a lost machine is noticed in a second instead of half a minute
    quick = {"health_check_initial_delay_ms": 0, "health_check_period_ms": 300, "health_check_failure_threshold": 3}
    head = {"num_cpus": 1, "include_dashboard": False, "_system_config": quick}
    made = Cluster(initialize_head=True, head_node_args=head)
    ray.init(address=made.address, log_to_driver=False, logging_level="ERROR")
    yield made
    ray.shutdown()
    made.shutdown()


def test_the_same_bits_as_in_one_process_also_where_workers_and_machines_are_lost(cluster: object) -> None:
    agent = make_agent()
    expected = InProcess(agent).run(agent.theta, tasks(200))
    second = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    seen: list[int] = []

    def lose() -> None:
        while len(seen) < 2:
            time.sleep(0.01)
        # a worker process that is at work, and then a machine
        for process in psutil.process_iter(["cmdline"]):
            if "run_batch" in " ".join(process.info["cmdline"] or []):
                process.send_signal(signal.SIGKILL)
                break
        cluster.remove_node(second, allow_graceful=False)

    with RayRollouts(agent) as rollouts:
        rollouts.run(agent.theta, tasks(4))
        thread = threading.Thread(target=lose)
        thread.start()
        found = rollouts.run(agent.theta, tasks(200), seen.append)
        thread.join()
        assert found == expected and seen[-1] == 200
        # another theta, and the machines that are left
        moved = agent.theta + np.float32(0.01)
        assert rollouts.run(moved, tasks(20)) == InProcess(agent).run(moved, tasks(20))


def test_what_fails_is_one_sentence(cluster: object) -> None:
    agent = make_agent()
    with RayRollouts(agent) as rollouts, pytest.raises(DrsError, match="its report"):
        rollouts.run(agent.theta[:-1], tasks(4))
    nobody = RayConfig(resources={"arm": 1.0}, patience_s=3.0)
    with RayRollouts(agent, nobody) as rollouts, pytest.raises(DrsError, match=r"no result for 3 s.*arm"):
        rollouts.run(agent.theta, tasks(2))
    with RayRollouts(agent) as rollouts:
        assert len(rollouts.run(agent.theta, tasks(2))) == 2


def test_a_run_on_ray_is_a_run_here(tmp_path: Path) -> None:
    agent = tmp_path / "agent.safetensors"
    make_agent().save(agent)
    common = ("--updates", 3, "--directions", 4, "--evaluate-every", 2, "--evaluation-episodes", 4)
    for where in ("local", "ray"):
        run = drs(
            "tune", agent, "--output", tmp_path / where, "--rollouts", where, "--workers", 1, *common, timeout=200
        )
        assert run.returncode == 0, run.stderr
    for name in ("agent.safetensors", "evaluations.jsonl"):
        assert (tmp_path / "local" / name).read_bytes() == (tmp_path / "ray" / name).read_bytes()


def copy_of_drs(folder: Path, name: str, old: str, new: str) -> Path:
    """Another drs for the workers: in the file of this name, one thing is another."""
    shutil.copytree(ROOT / "drs_core", folder / "drs_core", ignore=shutil.ignore_patterns("__pycache__", "agents"))
    file = folder / "drs_core" / name
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    return folder


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("__init__.py", f'"{__version__}"', '"0.0.1"'), ("has drs 0.0.1 (", f"this run is of drs {__version__}:")),
        (("search.py", "_DIRECTION, _EPISODE_SEED, _", "_EPISODE_SEED, _DIRECTION, _"), ("other perturbations",)),
        (("ray_rollouts/messages.py", "class Batch", "class Bundle"), (f"has other code of drs {__version__} (",)),
    ],
)
def test_workers_with_another_drs_are_refused(
    change: tuple[str, str, str], words: tuple[str, ...], tmp_path: Path
) -> None:
    agent, settings, empty = tmp_path / "agent.safetensors", tmp_path / "ray.yaml", tmp_path / "empty"
    make_agent().save(agent)
    other = copy_of_drs(tmp_path / "other", *change)
    settings.write_text(f"cpus: 1\nruntime_env: {{env_vars: {{PYTHONPATH: {other}}}}}\n")
    # workers look in the folder of whoever starts them, too
    empty.mkdir()
    options = ("--rollouts", "ray", "--ray", settings, "--updates", 1, "--directions", 2, "--evaluate-every", 0)
    command = [sys.executable, "-m", "drs_core.cli", "tune", agent, "--output", tmp_path / "run", *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "400"}
    result = subprocess.run(
        [str(word) for word in command], cwd=empty, env=environment, capture_output=True, text=True, timeout=120
    )
    refused(result, *words, "same on every machine")
    assert "lost" not in result.stderr and "x1b" not in result.stderr


def test_what_a_task_gives_is_looked_at_before_it_is_used(cluster: object, monkeypatch: pytest.MonkeyPatch) -> None:
    agent = make_agent()

    def none_at_all(agent, batch, theta):  # by value, as the real one
        from drs_core.ray_rollouts.messages import Answer

        return Answer(())

    def fails(agent, batch, theta):
        raise KeyError("a bug")

    def dies(agent, batch, theta):
        os._exit(1)

    monkeypatch.setattr("drs_core.ray_rollouts.cluster.MOST_RETRIES", 1)
    for entry, words in {
        none_at_all: "gave 0 episodes, not those of the 2",
        fails: "^A task failed on the cluster: KeyError: 'a bug'$",
        dies: "lost 1 times with its worker",
    }.items():
        monkeypatch.setattr("drs_core.ray_rollouts.cluster.worker_entry", lambda entry=entry: entry)
        with RayRollouts(agent) as rollouts, pytest.raises(DrsError, match=words):
            rollouts.run(agent.theta, tasks(2))
