"""A bug under a run ends its goal with a message and its progress as failed; the node goes on."""

from __future__ import annotations

from pathlib import Path

from action_msgs.msg import GoalStatus
from drs_interfaces.action import Tune
from drs_interfaces.msg import TuningProgress

from drs.qos import LATCHED
from tests.ros.arm_of_episodes import Arm, agent_in, offer, tuner
from tests.ros.graph import Graph

BUG = """
import sys
def hook(event, arguments):
    if event == "open" and str(arguments[0]).endswith("buggy/history.jsonl"):
        raise RuntimeError("a bug under the run")
sys.addaudithook(hook)
"""
"""For an interpreter that loads it as sitecustomize."""


def test_a_bug_fails_the_goal_and_not_the_node(graph: Graph, tmp_path: Path) -> None:
    _, begin = agent_in(tmp_path)
    (tmp_path / "sitecustomize.py").write_text(BUG)
    graph.environment["PYTHONPATH"] = f"{tmp_path}:{graph.environment.get('PYTHONPATH', '')}"
    offer(graph, Arm())
    node = tuner(graph, begin, tmp_path / "run", autostart=False, agents_root=tmp_path)
    graph.wait(lambda: node.said("ready"), "the tuner")
    shown: list[TuningProgress] = []
    graph.client.create_subscription(TuningProgress, "tuning/progress", shown.append, LATCHED)
    client = graph.action(Tune, "tune", "tuner_node")

    def tune(output: str) -> Tune.Impl.GetResultService.Response:
        goal = graph.finish(client.send_goal_async(Tune.Goal(output=output)), "the goal")
        return graph.finish(goal.get_result_async(), "its result")

    answer = tune("buggy")
    assert answer.status == GoalStatus.STATUS_ABORTED and not answer.result.success
    assert "RuntimeError: a bug under the run" in answer.result.message
    graph.wait(lambda: shown[-1].state == TuningProgress.FAILED, "the progress to say so")
    assert shown[-1].message == answer.result.message and node.said("Traceback")
    assert tune("sound").result.success
