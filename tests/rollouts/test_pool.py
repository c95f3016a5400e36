"""The pool gives what one process gives, whatever happens to its workers."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections import deque

import numpy as np
import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.environments import PAPER
from drs_core.errors import DrsError, UsageError
from drs_core.rollouts import InProcess, ProcessPool, Task, local
from drs_core.rollouts.pool import WorkerError, tasks_to_give
from drs_core.search import SearchConfig, ask
from tests.conftest import make_agent

MEASURES = frozenset({"dimension", "motion", "trajectory"})


def tasks_of(directions, update=0, measures=MEASURES):
    config = SearchConfig(directions=directions, sigma=(0.1, 0.1))
    return [Task(seed, measures, perturbation) for perturbation, seed in ask(config, update)]


def facts(episodes):
    return [
        (e.seed, e.return_, e.length, e.terminated, e.success, e.action_change, e.dimension, e.motion,
         None if e.tip_position is None else e.tip_position.tobytes())
        for e in episodes
    ]  # fmt: skip


@pytest.mark.parametrize("environment", ["HopperBulletEnv-v0", "PandaPush-v3", "BipedalWalker-v3"])
def test_the_same_episodes_in_any_number_of_workers(environment):
    agent = make_agent(environment)
    tasks = tasks_of(3)
    expected = facts(InProcess(agent).run(agent.theta, tasks))
    for workers in (1, 2):
        with ProcessPool(agent, workers) as pool:
            assert facts(pool.run(agent.theta, tasks)) == expected
            # and again, on workers that have a history now, in another order
            assert facts(pool.run(agent.theta, tasks[::-1])) == expected[::-1]


def test_a_new_theta_reaches_every_worker():
    agent = make_agent()
    other = (agent.theta + 1).astype(np.float32)
    tasks = [Task(seed) for seed in range(6)]
    with ProcessPool(agent, 2) as pool:
        first = facts(pool.run(agent.theta, tasks))
        assert facts(pool.run(other, tasks)) == facts(InProcess(agent).run(other, tasks)) != first


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGSEGV])
def test_workers_that_die_are_replaced_and_the_result_is_unchanged(sign):
    agent = make_agent("HopperBulletEnv-v0")
    tasks = tasks_of(20)
    expected = facts(InProcess(agent).run(agent.theta, tasks))
    with ProcessPool(agent, 2) as pool:
        before, killed = pool.pids, []

        def kill_one(done):
            if done in (5, 12):
                killed.append(pool.pids[done % 2])
                os.kill(killed[-1], sign)

        assert facts(pool.run(agent.theta, tasks, kill_one)) == expected
        assert len(killed) == 2 and not set(killed) & set(pool.pids)
        assert set(before) != set(pool.pids)
        # one that dies while it has nothing to do
        os.kill(pool.pids[0], sign)
        psutil.wait_procs([psutil.Process(pool.pids[0])], timeout=10)
        assert facts(pool.run(agent.theta, tasks[:6])) == expected[:6]


def test_an_episode_that_kills_every_worker_is_reported():
    agent = make_agent("HopperBulletEnv-v0")
    stop = threading.Event()
    pool = ProcessPool(agent, 1)

    def kill_all():
        while not stop.is_set():
            for pid in pool.pids:
                with contextlib.suppress(ProcessLookupError):  # it was replaced meanwhile
                    os.kill(pid, signal.SIGKILL)
            stop.wait(0.05)

    killer = threading.Thread(target=kill_all)
    killer.start()
    try:
        with pytest.raises(DrsError, match="3 times"):
            pool.run(agent.theta, tasks_of(40))
    finally:
        stop.set()
        killer.join()
        pool.close()


def test_a_failure_in_a_worker_arrives_with_its_cause():
    agent = make_agent()
    with ProcessPool(agent, 2) as pool, pytest.raises(WorkerError, match=r"(?s)Traceback.*environment\.reset\(seed\)"):
        pool.run(agent.theta, [Task(0), Task("no seed"), Task(1)])  # type: ignore[arg-type]


def test_workers_that_die_as_they_start_are_reported(tmp_path):
    """A large agent: what is sent to a dead process must not wait for a reader."""
    script = (
        "from tests.conftest import make_agent; from drs_core.rollouts import ProcessPool\n"
        "agent = make_agent('Pendulum-v1', (200, 200)); print('made', flush=True)\n"
        "ProcessPool(agent, 2)"
    )
    # spawned processes import the main module again, and standard input is none
    result = subprocess.run([sys.executable], input=script, capture_output=True, text=True, timeout=60)
    assert "made" in result.stdout and "ended before it was ready" in result.stderr


def test_an_agent_of_another_environment_is_refused_with_a_sentence():
    from dataclasses import replace

    with pytest.raises(UsageError, match="another environment") as here:
        InProcess(replace(make_agent(), environment="HopperBulletEnv-v0"))
    with pytest.raises(DrsError) as there:
        ProcessPool(replace(make_agent(), environment="HopperBulletEnv-v0"), 2)
    assert str(here.value) == str(there.value)


@pytest.mark.parametrize("workers", [-1, 257])
def test_numbers_of_workers_out_of_range(workers):
    with pytest.raises(UsageError, match="workers"):
        local(make_agent(), workers)


def test_closing_ends_every_process_and_leaves_no_shared_memory():
    # nodes of others come and go meanwhile
    there = lambda: {name for name in os.listdir("/dev/shm") if "fastrtps" not in name}  # noqa: E731
    before = there()
    pool = ProcessPool(make_agent(), 2)
    processes = [psutil.Process(pid) for pid in pool.pids]
    pool.close()
    assert not any(process.is_running() for process in processes)
    assert there() <= before


@pytest.mark.parametrize("environment", ["PandaPickAndPlace-v3", "AntBulletEnv-v0"])
def test_a_worker_is_small_and_imports_no_torch(environment):
    agent = make_agent(environment, hidden=(300, 300))  # above 100,000 parameters
    assert len(agent.theta) > 90_000
    with ProcessPool(agent, 1) as pool:
        pool.run(agent.theta, tasks_of(4))
        worker = psutil.Process(pool.pids[0])
        assert worker.memory_info().rss < 150e6
        assert not any("torch" in file.path for file in worker.memory_maps())


def test_every_environment_of_the_paper_runs_in_a_worker():
    for environment in PAPER:
        agent = make_agent(environment)
        with ProcessPool(agent, 1) as pool:
            (episode,) = pool.run(agent.theta, [Task(3, MEASURES)])
        assert episode.length > 0 and np.isfinite(episode.return_)
        assert (episode.motion is not None) == environment.startswith("Panda")


@settings(max_examples=200, deadline=None)
@given(
    durations=st.lists(st.floats(0.05, 1.0), min_size=60, max_size=200),
    workers=st.integers(1, 8),
)
def test_workers_end_together_and_sides_meet_in_one_worker(durations, workers):
    """Hands out in simulated time: rollouts of any length, nobody waits before the others' last ones."""
    waiting, free_at, held = deque(range(len(durations))), [0.0] * workers, [deque() for _ in range(workers)]
    ran_by, busy_until = {}, [0.0] * workers
    while waiting or any(held):
        for place in range(workers):
            for _ in range(tasks_to_give(len(held[place]), len(waiting), workers)):
                held[place].append(waiting.popleft())
        place = min((p for p in range(workers) if held[p]), key=lambda p: free_at[p] + durations[held[p][0]])
        task = held[place].popleft()
        free_at[place] += durations[task]
        ran_by[task], busy_until[place] = place, free_at[place]
    assert set(ran_by) == set(range(len(durations)))
    assert max(busy_until) - min(busy_until) <= 2 * max(durations)
    early = range(0, len(durations) - 4 * workers - 1, 2)
    assert all(ran_by[task] == ran_by[task + 1] for task in early)


def test_an_episode_longer_than_what_was_allocated_is_the_same(monkeypatch):
    agent = make_agent("Pendulum-v1")
    measures = frozenset({"dimension"})
    expected = InProcess(agent).run(agent.theta, [Task(seed, measures) for seed in (1, 2)])
    monkeypatch.setattr("drs_core.episode._ROWS", 3)
    assert InProcess(agent).run(agent.theta, [Task(seed, measures) for seed in (1, 2)]) == expected
