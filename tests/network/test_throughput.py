"""What a bad network costs, and a host that comes back: the long forms."""

from __future__ import annotations

import numpy as np
import pytest

from drs_core.agent import load
from drs_core.importing import resolve
from drs_core.rollouts import InProcess
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning
from tests.network.nodes import Nodes, cpu_s, history, rollouts_per_second
from tests.network.test_updates import BAD, SHORT
from tests.ros.test_rollouts import Silent, done

pytestmark = [pytest.mark.soak, pytest.mark.timeout(1800)]

NETWORKS = {"good": {}, "20 ms": {"delay_s": 0.02}, "2 %": {"loss": 0.02}, "20 ms, 2 %": BAD}
CYCLES, DIRECTIONS = 3, 8
TCP = {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"}


@pytest.mark.parametrize("environment", [{}, TCP], ids=["udp", "tcp"])
@pytest.mark.parametrize("agent", ["panda_reach", "panda_push"])
def test_throughput_of_one_network_beside_the_other(nodes: Nodes, agent: str, environment: dict[str, str]) -> None:
    # the networks take turns update by update, so that whatever else the machine does meets all of them
    networks = list(NETWORKS.items())
    updates = 1 + len(networks) * CYCLES
    settings = SHORT | {"agent": agent, "directions": DIRECTIONS, "updates": updates}
    nodes.simulators(**environment)
    tuner = nodes.tuner("run", settings, **environment)
    for update in range(1, updates):
        nodes.wait(lambda update=update: tuner.said(f"update {update}/"), f"update {update}", 200.0)
        nodes.network.impair(**networks[(update - 1) % len(networks)][1])
    nodes.finish(tuner, 200.0)
    lines = history(nodes.folder / "run")[1:]
    print(f"\n{agent}, {2 * DIRECTIONS} rollouts an update, {CYCLES} updates each, {environment or 'as it comes'}")
    for place, (name, _) in enumerate(networks):
        print(f"  {name:12} {rollouts_per_second(lines[place :: len(networks)]):6.1f} rollouts/s")
    # in this process, on a network that loses nothing
    start = resolve(agent)
    config = tune_config({key: value for key, value in settings.items() if key != "agent"})
    here = InProcess(start)
    try:
        again = Tuning(start, agent, config, nodes.folder / "again").run(here, Silent(), updates)
    finally:
        here.close()
    assert np.array_equal(load(nodes.folder / "run" / "agent.safetensors").theta, again.theta)


def test_a_host_that_comes_back_is_used_again(nodes: Nodes) -> None:
    victim, _ = nodes.simulators()
    tuner = nodes.tuner("run", SHORT | {"updates": 200, "call_deadline_s": 3.0})
    nodes.wait(lambda: tuner.said("update 1/"), "the first update")
    for time in (1, 2):
        nodes.network.impair(cut=[1])
        left = f"{victim.name} has not answered"
        nodes.wait(lambda left=left, time=time: tuner.log.read_text().count(left) >= time, "that it is missed", 60.0)
        nodes.network.impair()
        used_s = cpu_s(victim)
        # more than one that waits uses in this time
        nodes.wait(lambda used_s=used_s: cpu_s(victim) > used_s + 3.0, "its work", 90.0)
    assert not done(tuner)
