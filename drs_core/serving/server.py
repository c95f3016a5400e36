"""The whole way from measurements to commands, every guard in its place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from drs_core.serving import guards
from drs_core.serving.arm import Arm
from drs_core.serving.commanded import EARLY, REST_S, Commanded
from drs_core.serving.config import ServingConfig
from drs_core.serving.deciding import Act, Float32, Float64, Target, action_for, target_of
from drs_core.serving.inputs import Inputs
from drs_core.serving.kinematics import Kinematics
from drs_core.serving.measuring import Measured, measured
from drs_core.serving.motion import Motion, MotionLimiter, used_limits
from drs_core.serving.observing import Task
from drs_core.serving.results import OK, Effect, Result, Verdict
from drs_core.serving.states import ACTIVE, MOVING, Event, Stand, State

_PLANNED_MARGIN = 0.5
_EVENTS = {Effect.GO: Event.GOOD_INPUT, Effect.HOLD: Event.DOUBT, Effect.FAULT: Event.FAULT}


@dataclass(frozen=True, eq=False)
class Answer:
    """What the policy was shown, and what it said.

    Attributes:
        number: of the answers since the policy was activated, from 1.
        observation: by part, float32.
        step: steps taken before it since the goal came.
        target: where the answer sends the arm, with the action behind it.
    """

    number: int
    observation: Mapping[str, Float32]
    step: int
    target: Target


@dataclass(frozen=True, eq=False)
class _Decided:
    """What is measured, steps taken before it since the goal came, and where the policy goes from there."""

    seen: Measured
    step: int
    target: Target


@dataclass
class _SinceStart:
    """What is forgotten with every stop and fault; moments in s."""

    seen_s: float = -math.inf
    observed_s: float = -math.inf
    answered_s: float = -math.inf
    goal: Float64 | None = None
    step: int = 0
    answer: Answer | None = None


class Server:
    """Serves one agent to one arm.

    `observe` with the newest inputs once a policy period, `command` once a command period, both with
    one clock; `tell` and `report` for what happens outside. Nothing in here waits, publishes or locks.

    Attributes:
        stand: state, sentence and epoch.
    """

    def __init__(self, arm: Arm, task: Task, act: Act, config: ServingConfig | None = None) -> None:
        """Prepare everything; the state is unconfigured until told.

        Raises:
            DrsError: a library of the extra ``serve`` is not installed.
        """
        self.config = config = config or ServingConfig()
        self._arm, self._task, self._act = arm, task, act
        self.limits = used_limits(arm.limits, config)
        self._bounds = self.limits.position_min_rad, self.limits.position_max_rad
        self._kinematics = Kinematics(arm, config.tip_from_hand_m, config.posture_gain)
        # half the margin for the plan, the other half for the arm that follows it
        self._planned_box = guards.workspace(config, _PLANNED_MARGIN * config.workspace_margin_m)
        self._limiter = MotionLimiter(self.limits, config.command_period_s, self._keeps_tip_inside)
        self._commanded = Commanded(config.command_period_s)
        self.stand = Stand()
        self._since = _SinceStart()

    @property
    def answer(self) -> Answer | None:
        """The newest one since the policy was activated."""
        return self._since.answer

    @property
    def begins(self) -> bool:
        """Whether the next command would be the first of a motion that begins from rest."""
        return self.stand.state is State.WAITING or self._commanded.silent

    def tip_pose(self, motion: Motion) -> tuple[Float64, Float64]:
        """Where a command brings the tip: position (3,) [m], orientation (4,) x, y, z, w; in the frame of the base."""
        return self._kinematics.tip_position(motion.positions), self._kinematics.tip_orientation(motion.positions)

    def tell(self, event: Event) -> None:
        """Something happened outside: configured, activated, deactivated, cleaned up, reset."""
        before, self.stand = self.stand, self.stand.after(event)
        if before.state is not self.stand.state:
            self._forget()

    def report(self, verdict: Verdict) -> Verdict:
        """Something was found, in here or outside, such as another publisher of commands."""
        # most of the time, and nothing follows from it
        if verdict is OK and self.stand.state is State.RUNNING:
            return verdict
        event = _EVENTS.get(verdict.result.effect)
        if event is None:
            return verdict
        before = self.stand.state
        self.stand = self.stand.after(event, "" if verdict.result is Result.OK else verdict.sentence)
        if before is State.RUNNING and self.stand.state is State.HOLDING:
            self._limiter.stop()
        if self.stand.state not in ACTIVE:
            self._forget()
        return verdict

    def observe(self, inputs: Inputs, now_s: float) -> Verdict:
        """Let the policy act on inputs, and plan the way to where it sends the arm.

        Args:
            inputs: the newest of everything.
            now_s: the clock that the inputs' moments are of [s].
        """
        if self.stand.state not in ACTIVE:
            return Verdict(Result.NOT_ACTIVE)
        found = self._clock(now_s)
        if found is not None:
            return self.report(found)
        if now_s - self._since.observed_s < EARLY * self.config.policy_period_s:
            return Verdict(Result.TOO_SOON)
        self._since.observed_s = now_s
        return self.report(self._answer(inputs, now_s))

    def rehearse(self, inputs: Inputs, now_s: float) -> bool:
        """Go the way that `observe` and `command` will go next, and leave no trace; false where there is none to go.

        After milliseconds of idling a processor's caches hold the code and data of others, and the same
        step takes more than twice its time; who rehearses just before a step is due spares it that.
        """
        if self.stand.state is not State.RUNNING:
            return False
        decided = self._decided(inputs, now_s)
        if isinstance(decided, Verdict):
            return False
        self._limiter.rehearse(decided.target.joints)
        guards.publishable(self._commanded.history, self.limits, self.config.command_period_s)
        return True

    def watch(self, now_s: float) -> None:
        """Find a clock that went back, also one that keeps `observe` and `command` from being called."""
        if self.stand.state in ACTIVE:
            found = self._clock(now_s)
            if found is not None:
                self.report(found)

    def command(self, now_s: float, steady_s: float | None = None) -> Motion | None:
        """The next command, which keeps every limit after those before it; None where there is nothing to publish.

        Args:
            now_s: the clock of `observe` [s].
            steady_s: a clock that nobody sets, by which a gap between commands is told from a jump of the other [s].
        """
        if self.stand.state not in MOVING:
            return None
        found = self._clock(now_s)
        if found is not None:
            self.report(found)
            return None
        commanded = self._commanded
        if commanded.is_early(now_s):
            return None
        age_s = now_s - self._since.answered_s
        if self.stand.state is State.RUNNING and age_s > self.config.policy_period_s + self.config.input_age_max_s:
            self.report(Verdict(Result.STALE, f"The last good ones came {age_s:.3g} s ago."))
        gap_s = commanded.gap(now_s, steady_s)
        if gap_s > 0.0:
            # in the middle of its plan the arm would be expected where it was going, at the speed that it had
            commanded.silent = True
            self.report(Verdict(Result.INTERRUPTED, f"None came for {gap_s:.3g} s."))
        if self.stand.state is State.HOLDING and self._limiter.at_rest and not commanded.moves:
            commanded.silent = True
        if commanded.silent:
            return None
        motion = self._limiter.advance()
        commanded.push(motion.positions)
        found = guards.publishable(commanded.history, self.limits, self.config.command_period_s)
        if found is not None:
            self.report(found)
            return None
        commanded.published(now_s, steady_s)
        return motion

    def _forget(self) -> None:
        self._since = _SinceStart()
        self._commanded.forget()

    def _answer(self, inputs: Inputs, now_s: float) -> Verdict:
        epoch = self.stand.epoch
        decided = self._decided(inputs, now_s)
        # the policy took its time: meanwhile somebody may have said stop
        if self.stand.epoch != epoch or self.stand.state not in ACTIVE:
            return Verdict(Result.DROPPED)
        if isinstance(decided, Verdict):
            return decided
        seen, target = decided.seen, decided.target
        if self.begins:
            begin = self._commanded.beginning(seen.arm.positions)
            if not self._limiter.start(begin):
                return Verdict(Result.BAD_COMMAND, "No plan begins where the arm is.")
            self._commanded.begin(begin)
        # where no new plan keeps the limits, the old one does
        self._limiter.aim(target.joints)
        before = self._since.answer
        number = 1 if before is None else before.number + 1
        self._since.answer = Answer(number, seen.observation, decided.step, target)
        self._since.answered_s = now_s
        self._since.goal, self._since.step = seen.goal, decided.step + 1
        return OK

    def _decided(self, inputs: Inputs, now_s: float) -> _Decided | Verdict:
        """What the policy makes of inputs; changes nothing."""
        seen = measured(inputs, now_s, self._arm, self._task, self._kinematics, self.config)
        if isinstance(seen, Verdict):
            return seen
        found = self._ready(seen)
        if found is not None:
            return found
        same = self._since.goal is not None and seen.goal.tolist() == self._since.goal.tolist()
        step = self._since.step if same else 0
        action = action_for(seen.observation, step, self._act, self._task)
        if isinstance(action, Verdict):
            return action
        target = target_of(action, seen, self._task, self._kinematics, self._bounds, self.config)
        return target if isinstance(target, Verdict) else _Decided(seen, step, target)

    def _ready(self, seen: Measured) -> Verdict | None:
        if not self.begins:
            return guards.following(seen.arm.positions, self._limiter.now.positions, self.config)
        positions = self._commanded.beginning(seen.arm.positions)
        found = guards.at_rest(seen.arm, self.config)
        if self._commanded.may_still_move(self._since.seen_s):
            found = Verdict(Result.NOT_AT_REST, f"After a motion that was interrupted it has {REST_S} s for that.")
        found = found or guards.joints_inside(positions, *self._bounds, self._arm.joints)
        if found is None and not self._keeps_tip_inside(positions):
            return Verdict(Result.TIP_OUTSIDE, "A start is from the workspace and half its margin.")
        return found

    def _keeps_tip_inside(self, joints: Float64) -> bool:
        return guards.in_box(self._kinematics.tip(joints), self._planned_box)

    def _clock(self, now_s: float) -> Verdict | None:
        if not math.isfinite(now_s):
            return Verdict(Result.CLOCK, f"It says {now_s}.")
        if now_s < self._since.seen_s:
            return Verdict(Result.CLOCK, f"It went back by {self._since.seen_s - now_s:.3g} s.")
        self._since.seen_s = now_s
        return None
