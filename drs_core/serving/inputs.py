"""What an arm's drivers tell, as plain samples, and the arm's state read from them by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import shown
from drs_core.serving.arm import JOINTS, Arm
from drs_core.serving.results import Result, Verdict

Float64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointSample:
    """Joint states: names in any order, positions [rad, m], velocities per second, moment [s]."""

    names: Sequence[str]
    positions: Sequence[float] | Float64
    velocities: Sequence[float] | Float64
    stamp_s: float


@dataclass(frozen=True, eq=False)
class PoseSample:
    """A pose: position (3,) [m] and orientation (4,) x, y, z, w in a named frame, moment [s]."""

    frame: str
    position: Sequence[float] | Float64
    orientation: Sequence[float] | Float64
    stamp_s: float


@dataclass(frozen=True, eq=False)
class Inputs:
    """The newest of everything; None is what has not come.

    Attributes:
        joints: joint states of the arm, others among them are ignored.
        goal: where the tip or the object shall go; its moment does not matter.
        tip: None: computed from the joints.
        tip_velocity: (3,) [m/s]; None: computed from the joints' velocities.
        object: for tasks with one.
        object_velocity: (6,) linear, then angular [m/s, rad/s], for tasks with an object.
    """

    joints: JointSample | None
    goal: PoseSample | None
    tip: PoseSample | None = None
    tip_velocity: Float64 | None = None
    object: PoseSample | None = None
    object_velocity: Float64 | None = None

    def poses(self) -> list[tuple[str, PoseSample]]:
        """The poses that there are, with what a person calls them."""
        named = (("goal", self.goal), ("tip pose", self.tip), ("object pose", self.object))
        return [(name, pose) for name, pose in named if pose is not None]


@dataclass(frozen=True, eq=False)
class ArmState:
    """Measured joints, in the arm's order.

    Attributes:
        positions, velocities: (7,) [rad, rad/s].
        finger_width_m: both fingers together; 0 where they are not asked for.
    """

    positions: Float64
    velocities: Float64
    finger_width_m: float = 0.0


def arm_state(sample: JointSample, arm: Arm, with_fingers: bool) -> ArmState | Verdict:
    """The arm's joints of a sample, wherever they stand in it.

    Not finite comes first: a sample may be both.
    """
    names, positions, velocities = sample.names, sample.positions, sample.velocities
    if not len(names) == len(positions) == len(velocities):
        return Verdict(
            Result.INCOMPLETE,
            f"Joint states have {len(names)} names, {len(positions)} positions and {len(velocities)} velocities.",
        )
    places, problem = _places(tuple(names), arm.joints + arm.fingers if with_fingers else arm.joints)
    q, v = [positions[i] for i in places], [velocities[i] for i in places]
    if not (all(map(math.isfinite, q)) and all(map(math.isfinite, v))):
        wrong = [names[i] for i, a, b in zip(places, q, v) if not (math.isfinite(a) and math.isfinite(b))]
        return Verdict(Result.NOT_FINITE, f"Joint states of {shown(', '.join(wrong))} are not.")
    if problem is not None:
        return problem
    return ArmState(np.array(q[:JOINTS], np.float64), np.array(v[:JOINTS], np.float64), float(sum(q[JOINTS:])))


@lru_cache(maxsize=4)
def _places(names: tuple[str, ...], wanted: tuple[str, ...]) -> tuple[list[int], Verdict | None]:
    """Where the wanted names stand, and what is wrong with the names; a driver names its joints alike every time."""
    index = {name: i for i, name in enumerate(names)}
    places = [index[name] for name in wanted if name in index]
    twice = sorted({name for name in wanted if names.count(name) > 1})
    if len(places) < len(wanted):
        missing = ", ".join(name for name in wanted if name not in index)
        return places, Verdict(Result.INCOMPLETE, f"Joint states lack {missing}.")
    if twice:
        return places, Verdict(Result.INCOMPLETE, f"Joint states name {', '.join(twice)} more than once.")
    return places, None
