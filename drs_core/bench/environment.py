"""One environment's part of a benchmark: its variants made, warmed up and measured in turn."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from statistics import mean
from typing import Any

from drs_core.accelerator import PYTHON
from drs_core.agent import Agent
from drs_core.bench.agents import bench_agent, description
from drs_core.bench.config import BenchConfig
from drs_core.bench.interleave import interleaved
from drs_core.bench.processes import resident_mb
from drs_core.bench.sample import Sample
from drs_core.bench.summary import ratios, throughput, variant_summary
from drs_core.bench.variants import Absent, Entry, Variant, pairs
from drs_core.environments import quiet
from drs_core.rollouts import InProcess, ProcessPool, Task

Say = Callable[[str], None]

FIRST_SEED = 0
_GAUGE_ROLLOUTS = 2


def bench_environment(
    environment_id: str, config: BenchConfig, entries: Mapping[str, Entry], say: Say, done: Callable[[], None]
) -> dict[str, Any]:
    """Measure the variants in one environment.

    Args:
        environment_id: one of the paper's.
        config: what to run.
        entries: variants to measure.
        say: gets a line for every variant that is left out.
        done: called after every turn.
    """
    agent = bench_agent(environment_id, config.agents)
    steps = config.steps or _steps(agent, config.turn_s)
    with ExitStack() as stack:
        made, skipped = _make(agent, entries, stack)
        for name, why in skipped.items():
            say(f"{environment_id}: {entries[name].title} left out: {why}")
        with _nothing_to_collect():
            jobs = {name: partial(_turn, variant, steps) for name, variant in made.items()}
            samples = interleaved(jobs, config.rounds, done)
        memory = [resident_mb(pid) for variant in made.values() for pid in _pids(variant)]
    episode_steps = _episode_steps(samples, agent)
    result: dict[str, Any] = {
        "agent": description(agent),
        "parameters": len(agent.theta),
        "steps": steps,
        "episode_steps": episode_steps,
        "variants": {name: variant_summary(rounds, episode_steps) for name, rounds in samples.items()},
        "ratios": ratios(samples, pairs()),
        "throughput": {},
        "worker_memory_mb": max(memory) if memory else None,
        "skipped": skipped,
    }
    for faster, slower in (("workers_2", "workers_1"), ("ros", "workers_2")):
        if faster in samples and slower in samples:
            result["throughput"][f"{faster}/{slower}"] = throughput(samples[faster], samples[slower])
    return result


def _turn(variant: Variant, steps: int, index: int) -> Sample:
    return variant.run(FIRST_SEED + index, steps)


def _steps(agent: Agent, turn_s: float) -> int:
    """How many steps this project takes in `turn_s` of CPU time."""
    from drs_core.bench.variants.ours import OneByOne

    variant = OneByOne(agent, InProcess(agent))
    try:
        variant.run(FIRST_SEED, 1)
        gauged = [variant.run(FIRST_SEED + index, 1) for index in range(_GAUGE_ROLLOUTS)]
    finally:
        variant.close()
    return max(1, round(1e6 * turn_s / mean(sample.cpu_us_per_step for sample in gauged)))


def _make(agent: Agent, entries: Mapping[str, Entry], stack: ExitStack) -> tuple[dict[str, Variant], dict[str, str]]:
    """Variants by name, each having run once, and why the others are missing."""
    made: dict[str, Variant] = {}
    skipped: dict[str, str] = {}
    for name, entry in entries.items():
        try:
            # PyBullet prints a line for every client
            with quiet():
                variant = entry.make(agent)
        except Absent as error:
            skipped[name] = str(error)
            continue
        stack.callback(variant.close)
        # the first episode loads libraries and fills caches
        with quiet():
            variant.run(FIRST_SEED, 1)
        made[name] = variant
    return made, skipped


@contextmanager
def _nothing_to_collect() -> Iterator[None]:
    """What is there now is not looked at by the garbage collector: peers' libraries would slow everybody's turns."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _pids(variant: Variant) -> list[int]:
    rollouts = getattr(variant, "rollouts", None)
    return rollouts.pids if isinstance(rollouts, ProcessPool) else []


def _episode_steps(samples: Mapping[str, list[Sample]], agent: Agent) -> float:
    """Mean length of this project's episodes over the rounds; of one of them where it was not measured."""
    ours = samples.get(PYTHON) or samples.get("workers_1") or samples.get("workers_2") or samples.get("ros")
    if ours:
        return mean(sample.steps / sample.rollouts for sample in ours)
    rollouts = InProcess(agent)
    try:
        return float(rollouts.run(agent.theta, [Task(FIRST_SEED)])[0].length)
    finally:
        rollouts.close()
