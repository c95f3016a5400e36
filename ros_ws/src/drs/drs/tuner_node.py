"""tuner_node: direct random search over every simulator node of the graph; evaluation beside it."""

from __future__ import annotations

import threading
import traceback
from functools import partial
from typing import Any

import rclpy
from drs_interfaces.action import Tune
from drs_interfaces.msg import TuningProgress
from drs_interfaces.srv import Evaluate
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import Executor, MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from drs.agent_names import requested_agent
from drs.answering import offer
from drs.attending import Attending
from drs.conversions import evaluation_to_msg
from drs.declare import declare
from drs.diagnostics import Diagnostics, tuning_status
from drs.discovery import see_whole_graph
from drs.fleet import Fleet
from drs.progress import Progress
from drs.run_node import run_node
from drs.tuner import MOST_EVALUATIONS, Settings, Tuner
from drs.tuner_parameters import PARAMETERS, job_from
from drs.turns import Stopped
from drs_core.errors import DrsError, UsageError, presentable
from drs_core.evaluation import summary


class TunerNode(Node):
    """Declares, wires, converts and calls."""

    exit_status = 0

    def __init__(self) -> None:
        """Offer everything, and begin to tune where `autostart` says so."""
        super().__init__("tuner_node")
        self._p, self._stop = declare(self, PARAMETERS), threading.Event()
        fleet = Fleet(self)
        names = ("call_deadline_s", "evaluation_patience_s", "backend", "attempts")
        settings = Settings(*(self._p[name] for name in names))
        self._tuner = Tuner(fleet, settings, self._stopping, self.get_logger().info, self.get_logger().warning)
        self._progress = Progress(self, fleet.count)
        Diagnostics(self, lambda: tuning_status(self._progress.message, fleet.count()))
        group = ReentrantCallbackGroup()
        offer(self, Evaluate, "evaluate", self._evaluate, group)
        offer(self, Trigger, "~/pause", self._pause, group)
        offer(self, Trigger, "~/resume", self._resume, group)
        self._action = ActionServer(
            self, Tune, "tune", self._tune, callback_group=group, cancel_callback=lambda _: CancelResponse.ACCEPT
        )
        if self._p["autostart"]:
            job_from(self._p)  # a wrong parameter ends the node at once
            # not a timer that cancels itself: the executor may hold its next call already, and fails then
            self._begun = threading.Lock()
            self.create_guard_condition(self._tune_once, group).trigger()
        self.get_logger().info(f"ready: {self._p['agent']}")

    def destroy_node(self) -> None:
        """Stop what is under way; run folders can be continued."""
        self._stop.set()
        super().destroy_node()

    def _stopping(self) -> bool:
        return self._stop.is_set() or not rclpy.ok()

    def _tune_once(self) -> None:
        if not self._begun.acquire(blocking=False):
            return
        result = self._run(None, None)
        if self._p["exit_when_done"] and not self._stopping():
            self.exit_status = 0 if result.success else 1
            rclpy.try_shutdown()

    def _tune(self, goal: ServerGoalHandle) -> Tune.Result:
        result = self._run(goal.request, goal)
        if not self._stopping():
            end = goal.succeed if result.success else goal.canceled if goal.is_cancel_requested else goal.abort
            end()
        return result

    def _run(self, request: Tune.Goal | None, goal: ServerGoalHandle | None) -> Tune.Result:
        progress, result = self._progress, Tune.Result()
        feedback = (lambda message: goal.publish_feedback(Tune.Feedback(progress=message))) if goal else None
        try:
            job = job_from(self._p, request)
            result.output = str(job.output)
            cancelled = lambda: goal is not None and goal.is_cancel_requested  # noqa: E731
            begun = lambda done: progress.begin(job, done, feedback)  # noqa: E731
            attend = partial(Attending, progress, self._tuner.pause, self._p["pause_each_update"])
            flat = self._tuner.tune(job, progress, begun, cancelled, attend).flat
            result.success, state = True, TuningProgress.DONE
            why = f"{flat.sentence()} The best agent is {job.output}/best.safetensors." if flat else ""
            result.message = f"Tuned {job.name}: {job.output}/agent.safetensors. {why}".strip()
        except Stopped:
            state, result.message = TuningProgress.STOPPED, "Stopped; the run folder can be continued."
        except Exception as error:
            if not isinstance(error, DrsError) and self._stopping():
                # the context ends under whatever publishes
                raise
            state, result.success, result.message = TuningProgress.FAILED, False, self._why(error)
            if self._tuner.tuning:
                # what the topic tells is of the run that is under way
                self.get_logger().warning(f"A goal is refused: {result.message}")
                return result
        result.updates_done, result.return_mean = progress.message.update, progress.message.return_mean
        if not self._stopping():
            progress.say(state, result.message)
        return result

    def _why(self, error: Exception) -> str:
        if isinstance(error, DrsError):
            return str(error)
        # a bug: whoever sent the goal has to know that the run has ended, and whoever mends it where
        self.get_logger().error(traceback.format_exc())
        return presentable(f"The run failed inside the node ({type(error).__name__}: {error}); see its log.")

    def _evaluate(self, request: Any, response: Any) -> None:
        name, agent = requested_agent(request.agent, self._p["agent"], self._p["agents_root"])
        episodes = request.episodes or self._p["evaluation_episodes"]
        evaluation, message = self._tuner.evaluate(name, agent, episodes, request.seed or self._p["evaluation_seed"])
        evaluation_to_msg(response, summary(evaluation), evaluation, message)

    def _pause(self, _: Any, response: Any) -> None:
        self._tuner.pause.ask()
        when = "Pausing before the next update" if self._tuner.tuning else "Paused"
        response.message = f"{when}: nothing begins to move until ~/resume is called; what moves now is finished first."

    def _resume(self, _: Any, response: Any) -> None:
        if not self._tuner.pause.end():
            raise UsageError("Nothing is paused now; call ~/resume when tuning/progress says so.")
        response.message = "Going on."


def _executor() -> Executor:
    # evaluations and a run each hold a thread while they wait; the others take the answers
    return MultiThreadedExecutor(num_threads=MOST_EVALUATIONS + 5)


def main() -> None:
    """Run the node."""
    see_whole_graph()
    run_node(TunerNode, _executor)
