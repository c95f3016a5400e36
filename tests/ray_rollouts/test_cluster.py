"""A Ray cluster on this machine: the bits of one process, whatever is lost on the way."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from drs_core.errors import DrsError
from drs_core.ray_rollouts import RayConfig, RayRollouts
from drs_core.rollouts import InProcess, Task
from drs_core.search import Perturbation
from tests.conftest import drs, make_agent

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install -c constraints.txt -e '.[ray]'")

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
