"""Nothing grows and nothing is lost in long work; each test has a short form, and a long one for `make soak`."""

from __future__ import annotations

import json
import os
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from drs_interfaces.msg import Candidate
from drs_interfaces.srv import LoadAgent, RunEpisodes

from drs_core import json_lines
from drs_core.importing import resolve
from drs_core.rollouts import local
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning
from tests.conftest import make_agent
from tests.ros.graph import Graph
from tests.ros.test_rollouts import Silent

BATCH = 200
LOST = ("has not answered", "cannot take part", "went away", "Traceback")


def shared_memory(process: psutil.Process) -> int:
    return sum(region.path.startswith("/dev/shm") for region in process.memory_maps(grouped=True))


@pytest.mark.parametrize("episodes", [4_000, pytest.param(200_000, marks=pytest.mark.soak)])
def test_a_simulator_does_not_grow(graph: Graph, tmp_path: Path, episodes: int) -> None:
    # a random policy falls within some twenty steps
    agent = tmp_path / "random.safetensors"
    agent.write_bytes(make_agent("HopperBulletEnv-v0").to_bytes())
    node = graph.start_ready("simulator_node", environment="HopperBulletEnv-v0", stream=False, agent=agent)
    assert graph.call(LoadAgent, "simulator_node/load_agent").success
    client = graph.client.create_client(RunEpisodes, "simulator_node/run_episodes")
    request = RunEpisodes.Request(candidates=[Candidate(episode_seed=seed) for seed in range(BATCH)])
    process, sizes, first = psutil.Process(node.process.pid), [], None
    for done in range(0, episodes, BATCH):
        answer = graph.finish(client.call_async(request), f"episodes from {done}")
        assert answer.success and len(answer.episodes) == BATCH
        told = [(e.seed, e.return_sum, e.length) for e in answer.episodes]
        first = first or told
        assert told == first, f"other episodes than before after {done}"
        # the first fifth is for caches to fill
        if done >= episodes // 5:
            sizes.append((process.memory_info().rss / 1e6, process.num_fds(), shared_memory(process)))
    memory_mb, descriptors, files = map(np.array, zip(*sizes))
    print(f"{episodes} episodes: {memory_mb[0]:.1f} to {memory_mb[-1]:.1f} MB, {descriptors[-1]} descriptors")
    assert memory_mb.max() <= 1.02 * memory_mb[0]
    assert len(set(descriptors)) == 1 and len(set(files)) == 1


@pytest.mark.parametrize(("updates", "hours"), [(2, 0.0), pytest.param(100_000, 1.0, marks=pytest.mark.soak)])
def test_six_processes_lose_no_call(graph: Graph, tmp_path: Path, updates: int, hours: float) -> None:
    settings: dict[str, Any] = {"objective": "smooth", "updates": updates, "directions": 16, "evaluation_episodes": 4}
    settings |= {"evaluate_every": 2, "seed": 0}
    # one simulator streams, and runs episodes in the same process
    graph.start_ready("simulator_node", "streaming", environment="PandaReach-v3")
    graph.start_ready("simulator_node", "quiet", stream=False)
    graph.start_ready("policy_node", autostart=True)
    graph.start_ready("mock_arm_node")
    graph.start_ready("recorder_node", output=tmp_path / "graph.mcap", topics="/status,/diagnostics,/progress")
    tuner = graph.start(
        "tuner_node", autostart=True, exit_when_done=True, output=tmp_path / "there", call_deadline_s=120.0, **settings
    )
    end = time.monotonic() + 3600.0 * hours
    graph.wait(
        lambda: tuner.process.poll() is not None or (hours > 0 and time.monotonic() > end),
        "the run",
        patience_s=180.0 + 3600.0 * hours,
    )
    assert hours > 0 or tuner.process.returncode == 0
    # interrupted, it keeps what is done
    if hours:
        assert tuner.process.poll() is None
        tuner.interrupt()
    for node in graph.nodes:
        assert not any(node.said(words) for words in LOST), node.log.read_text()
    done = len(json_lines.read(tmp_path / "there/history.jsonl"))
    print(f"{done} updates over the graph")
    assert done == updates or (hours > 0 and done >= 2)
    agent = resolve("panda_reach")
    with closing(local(agent, os.cpu_count() or 1)) as rollouts:
        Tuning(agent, "panda_reach", tune_config(settings), tmp_path / "here").run(rollouts, Silent(), done)
    here, there = (decided(tmp_path / where / "history.jsonl") for where in ("here", "there"))
    assert here == there
    here, there = (decided(tmp_path / where / "evaluations.jsonl") for where in ("here", "there"))
    # the last one may have been under way
    assert here[: len(there)] == there and len(here) - len(there) <= bool(hours)
    assert (tmp_path / "here/agent.safetensors").read_bytes() == (tmp_path / "there/agent.safetensors").read_bytes()


def decided(path: Path) -> list[str]:
    """Records without what a clock decides."""
    return [
        json.dumps({key: value for key, value in record.items() if key not in ("wall_s", "rollouts_per_second")})
        for record in json_lines.read(path)
    ]
