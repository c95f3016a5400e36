"""Updates over simulators on other hosts come out as in one process, whatever the network does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from drs_core.agent import Agent, load
from drs_core.importing import resolve
from tests.network.conftest import UPDATES
from tests.network.nodes import Nodes, cpu_s, history, rollouts_per_second
from tests.ros.graph import NodeProcess
from tests.ros.test_rollouts import SETTINGS, in_process, same

SHORT = SETTINGS | {"updates": UPDATES}
LONG = SETTINGS | {"updates": 200}
BAD = {"delay_s": 0.02, "loss": 0.02}


@pytest.fixture(scope="module")
def simulators(shared_nodes: Nodes) -> list[NodeProcess]:
    return shared_nodes.simulators()


@pytest.mark.parametrize("impairment", [{}, BAD], ids=["a good network", "20 ms and 2 %"])
def test_an_update_is_the_same_bit_for_bit(
    shared_nodes: Nodes, simulators: list[NodeProcess], impairment: dict[str, Any], tmp_path: Path
) -> None:
    before, run = shared_nodes.network.impair(**impairment), "bad" if impairment else "good"
    earlier_s = [cpu_s(node) for node in simulators]

    def both_ran_episodes() -> bool:
        used_s = [cpu_s(node) - earlier for node, earlier in zip(simulators, earlier_s)]
        return min(used_s) > max(0.5, 0.1 * sum(used_s))

    tuner = shared_nodes.tuner(run, LONG)
    # on a bad network one may be found some updates later than the other
    shared_nodes.wait(lambda: tuner.said(f"update {UPDATES}/") and both_ran_episodes(), "both to run episodes")
    tuner.interrupt()
    after, folder = shared_nodes.network.impair(), shared_nodes.folder / run
    done = load(folder / "agent.safetensors").tuning[-1]["updates_done"]
    assert done >= UPDATES
    assert same(folder, in_process(tmp_path / "again", LONG["updates"], done))
    # what they ran went through the switch
    for host in shared_nodes.network.hosts[1:]:
        got = after.unicast[host.number][0] - before.unicast[host.number][0]
        assert got > len(resolve("panda_reach").to_bytes())
    assert (after.lost > before.lost) == bool(impairment)
    print(f"{run} network: {rollouts_per_second(history(folder)):.1f} rollouts/s")


@pytest.mark.usefixtures("simulators")
def test_it_is_the_same_where_a_host_is_cut_off(shared_nodes: Nodes, expected: Agent) -> None:
    before = shared_nodes.network.impair()
    tuner = shared_nodes.tuner("cut", SHORT | {"call_deadline_s": 3.0})
    shared_nodes.wait(lambda: tuner.said("update 1/"), "the first update")
    # both have episodes under way by now
    shared_nodes.network.impair(cut=[1])
    shared_nodes.finish(tuner)
    assert shared_nodes.network.impair().blocked > before.blocked
    assert same(shared_nodes.folder / "cut", expected)
