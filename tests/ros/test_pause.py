"""A person beside the arm: it says what comes next, waits where it is told to, and comes out the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from drs_interfaces.action import Tune
from drs_interfaces.msg import TuningProgress
from drs_interfaces.srv import Evaluate
from std_srvs.srv import Trigger

from drs.qos import LATCHED
from tests.ros.arm_of_episodes import CONFIG, Arm, agent_in, ended, offer, tuner
from tests.ros.graph import Graph
from tests.ros.test_rollouts import same
from tests.test_tuning import tune


class Watching:
    """The newest message on tuning/progress."""

    def __init__(self, graph: Graph) -> None:
        self.newest = TuningProgress()
        graph.client.create_subscription(TuningProgress, "tuning/progress", self._take, LATCHED)

    def _take(self, message: TuningProgress) -> None:
        self.newest = message

    def paused_before(self, what: str) -> bool:
        paused = self.newest.state == TuningProgress.PAUSED
        return paused and f"Paused before {what}" in self.newest.message and self.newest.next.startswith("Next: ")


def resume(graph: Graph) -> Trigger.Response:
    return graph.call(Trigger, "tuner_node/resume")


def test_each_update_waits_for_a_person_and_the_result_is_the_same(graph: Graph, tmp_path: Path) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    arm, watching = offer(graph, Arm()), Watching(graph)
    node = tuner(graph, begin, tmp_path / "run", pause_each_update=True)
    moved = 0
    for update in (1, 2, 3):
        graph.wait(lambda update=update: watching.paused_before(f"update {update} of 3"), f"a pause before {update}")
        assert sum(arm.runs.values()) == moved
        # evaluations come with updates 1 and 3
        also = " and 3 with the policy as it is" if update != 2 else ""
        sigma = f"{CONFIG.search.sigma_at(update - 1):.4g}"
        text = f"Next: update {update} of 3: 8 episodes with the policy changed by sigma {sigma}{also}"
        text += ", each of at most 33.3 s (999 steps at 30 Hz), "
        assert watching.newest.next.startswith(text) and node.said(text)
        answer = resume(graph)
        assert answer.success and answer.message == "Going on."
        graph.wait(lambda update=update: node.said(f"update {update}/3"), f"update {update}")
        moved = sum(arm.runs.values())
    ended(graph, node)
    assert node.process.returncode == 0 and same(tmp_path / "run", expected)


@pytest.mark.parametrize("at", [1, 2])
def test_it_ends_while_it_is_paused_and_goes_on_from_there(graph: Graph, tmp_path: Path, at: int) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    offer(graph, Arm())
    watching = Watching(graph)
    node = tuner(graph, begin, tmp_path / "run", pause_each_update=True)
    for update in range(1, at + 1):
        graph.wait(lambda update=update: watching.paused_before(f"update {update} of 3"), f"a pause before {update}")
        if update < at:
            resume(graph)
    status, took_s = node.interrupt()
    assert status == 0 and took_s < 10.0
    again = tuner(graph, begin, tmp_path / "run", "again")
    ended(graph, again)
    assert again.process.returncode == 0 and same(tmp_path / "run", expected)


def test_a_pause_takes_effect_between_updates_keeps_all_still_and_can_be_cancelled(
    graph: Graph, tmp_path: Path
) -> None:
    agent, begin = agent_in(tmp_path)
    expected = tune(agent, tmp_path / "expected", config=CONFIG)
    arm, watching = offer(graph, Arm()), Watching(graph)
    node = tuner(graph, begin, tmp_path / "unused", autostart=False, agents_root=tmp_path)
    graph.wait(lambda: node.said("ready"), "the tuner")
    answer = resume(graph)
    assert not answer.success and "Nothing is paused" in answer.message
    assert graph.call(Trigger, "tuner_node/pause").success

    client = graph.action(Tune, "tune", "tuner_node")
    goal = graph.finish(client.send_goal_async(Tune.Goal(output="run")), "the goal")
    graph.wait(lambda: watching.paused_before("update 1 of 3"), "the pause before the first update")
    assert not arm.runs
    for output, why in (("other", "Another run is under way"), ("../out", "not a plain name")):
        other = graph.finish(client.send_goal_async(Tune.Goal(output=output)), "another goal")
        result = graph.finish(other.get_result_async(), "its refusal").result
        assert not result.success and why in result.message
    # the topic tells of the run that is under way
    refused = graph.call(Evaluate, "/evaluate", Evaluate.Request(episodes=2))
    assert not refused.success and "~/resume" in refused.message
    assert watching.paused_before("update 1 of 3") and node.said("A goal is refused")
    graph.finish(goal.cancel_goal_async(), "the cancelling")
    result = graph.finish(goal.get_result_async(), "the result").result
    assert not result.success and "can be continued" in result.message
    assert not arm.runs
    graph.wait(lambda: watching.newest.state == TuningProgress.STOPPED, "the end on the topic")
    assert watching.newest.next == ""

    # the person's pause outlives the goal
    goal = graph.finish(client.send_goal_async(Tune.Goal(output="run")), "the second goal")
    graph.wait(lambda: watching.paused_before("update 1 of 3"), "the pause again")
    assert resume(graph).success
    graph.wait(lambda: bool(arm.runs), "the first episode")
    answer = graph.call(Trigger, "tuner_node/pause")
    assert answer.success and "Pausing before the next update" in answer.message
    graph.wait(lambda: watching.paused_before("update 2 of 3"), "the pause between two updates")
    assert node.said("update 1/3")
    count = sum(arm.runs.values())
    assert resume(graph).success
    result = graph.finish(goal.get_result_async(), "the second result").result
    assert result.success, result.message
    assert sum(arm.runs.values()) > count
    assert same(tmp_path / "run", expected)
    assert graph.call(Evaluate, "/evaluate", Evaluate.Request(episodes=2)).success
