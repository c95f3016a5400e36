"""Updates over simulators on other hosts come out as in one process, whatever the network does."""

from __future__ import annotations

from typing import Any

import pytest

from drs_core.agent import Agent
from drs_core.importing import resolve
from tests.network.conftest import UPDATES
from tests.network.nodes import Nodes, cpu_s, history, rollouts_per_second
from tests.ros.graph import NodeProcess
from tests.ros.test_rollouts import SETTINGS, same

SHORT = SETTINGS | {"updates": UPDATES}
BAD = {"delay_s": 0.02, "loss": 0.02}


@pytest.fixture(scope="module")
def simulators(shared_nodes: Nodes) -> list[NodeProcess]:
    return shared_nodes.simulators()


@pytest.mark.parametrize("impairment", [{}, BAD], ids=["a good network", "20 ms and 2 %"])
def test_an_update_is_the_same_bit_for_bit(
    shared_nodes: Nodes,
    simulators: list[NodeProcess],
    impairment: dict[str, Any],
    expected: Agent,
) -> None:
    before, run = shared_nodes.network.impair(**impairment), "bad" if impairment else "good"
    used_s = [cpu_s(node) for node in simulators]
    shared_nodes.finish(shared_nodes.tuner(run, SHORT))
    after = shared_nodes.network.impair()
    assert same(shared_nodes.folder / run, expected)
    # both ran episodes, and what they ran went through the switch
    used_s = [cpu_s(node) - earlier_s for node, earlier_s in zip(simulators, used_s)]
    assert min(used_s) > 0.1 * sum(used_s)
    for host in shared_nodes.network.hosts[1:]:
        got = after.unicast[host.number][0] - before.unicast[host.number][0]
        assert got > len(resolve("panda_reach").to_bytes())
    assert (after.lost > before.lost) == bool(impairment)
    print(f"{run} network: {rollouts_per_second(history(shared_nodes.folder / run)):.1f} rollouts/s")


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
