"""A seven-joint arm in numbers: its geometry and its limits, from the files in `arms/`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError, shown
from drs_core.plain_yaml import read_plain_yaml

Float64 = NDArray[np.float64]

JOINTS = 7
_FOLDER = Path(__file__).with_name("arms")
_FILES = {"panda": "panda.yaml", "fer": "panda.yaml", "fr3": "fr3.yaml"}
ARM_IDS = tuple(_FILES)
_TIP_LIMITS = ("tip_velocity_max_m_s", "tip_acceleration_max_m_s2", "tip_jerk_max_m_s3")


@dataclass(frozen=True, eq=False)
class JointLimits:
    """What the joints may do, each (7,) float64.

    Attributes:
        position_min_rad, position_max_rad: range of positions.
        velocity_max_rad_s, acceleration_max_rad_s2, jerk_max_rad_s3: in either direction.
    """

    position_min_rad: Float64
    position_max_rad: Float64
    velocity_max_rad_s: Float64
    acceleration_max_rad_s2: Float64
    jerk_max_rad_s3: Float64

    def __post_init__(self) -> None:
        """Raise UsageError where a limit is not finite, not positive, or a range is empty."""
        for name, values in vars(self).items():
            _check_seven(name, values)
            if not name.startswith("position") and not (values > 0.0).all():
                raise UsageError(f"{name} is {shown(values.tolist())}; allowed are numbers above 0.")
        if not (self.position_min_rad < self.position_max_rad).all():
            raise UsageError(
                f"position_min_rad {shown(self.position_min_rad.tolist())} must lie below "
                f"position_max_rad {shown(self.position_max_rad.tolist())}."
            )


@dataclass(frozen=True, eq=False)
class Arm:
    """One kind of arm.

    Attributes:
        id: what joints and frames are named after, such as ``panda``.
        limits: of its joints.
        dh_a_m, dh_d_m, dh_alpha_rad: (7,) Denavit-Hartenberg parameters in Craig's convention.
        flange_m: from joint 7 to the flange, along z.
        hand_yaw_rad: the hand on the flange, about z.
        neutral_rad: (7,) where panda-gym's episodes begin.
        tip_limits: (3,) velocity, acceleration and jerk of the tip [m/s, m/s^2, m/s^3], which the arm
            judges where it is commanded by poses.
    """

    id: str
    limits: JointLimits
    dh_a_m: Float64
    dh_d_m: Float64
    dh_alpha_rad: Float64
    flange_m: float
    hand_yaw_rad: float
    neutral_rad: Float64
    tip_limits: Float64
    joints: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Name the joints; raise UsageError where a number is not usable."""
        for name in ("dh_a_m", "dh_d_m", "dh_alpha_rad", "neutral_rad"):
            _check_seven(name, getattr(self, name))
        if not np.isfinite([self.flange_m, self.hand_yaw_rad]).all():
            raise UsageError(f"flange_m {self.flange_m} and hand_yaw_rad {self.hand_yaw_rad} must be finite.")
        if self.tip_limits.shape != (3,) or not (np.isfinite(self.tip_limits) & (self.tip_limits > 0.0)).all():
            raise UsageError(f"tip_limits are {shown(self.tip_limits.tolist())}; they must be three numbers above 0.")
        object.__setattr__(self, "joints", tuple(f"{self.id}_joint{number}" for number in range(1, JOINTS + 1)))

    @property
    def fingers(self) -> tuple[str, str]:
        """Names of the hand's joints."""
        return f"{self.id}_finger_joint1", f"{self.id}_finger_joint2"

    @property
    def base_frame(self) -> str:
        """Name of the frame that poses are given in."""
        return f"{self.id}_link0"


def read_arm(arm_id: str, path: Path | None = None) -> Arm:
    """The arm of an arm_id, from its own file or another of the same layout.

    Raises:
        UsageError: there is none of that name, or a number in the file is not usable.
    """
    if path is None:
        if arm_id not in _FILES:
            raise UsageError(f"arm_id {shown(arm_id)} is unknown; known are {', '.join(ARM_IDS)}.")
        path = _FOLDER / _FILES[arm_id]
    content = read_plain_yaml(path)
    if not isinstance(content, dict):
        raise UsageError(f"{path} does not hold an arm's numbers by name.")
    known = content.get("arm_ids")
    if not isinstance(known, list) or arm_id not in known:
        raise UsageError(f"{path} is of arm_ids {shown(known)}, not {shown(arm_id)}; take that arm's own file.")
    try:
        return Arm(
            id=arm_id,
            limits=JointLimits(**{name: _seven(content, name) for name in JointLimits.__dataclass_fields__}),
            dh_a_m=_seven(content, "dh_a_m"),
            dh_d_m=_seven(content, "dh_d_m"),
            dh_alpha_rad=np.radians(_seven(content, "dh_alpha_deg")),
            flange_m=_number(content, "flange_m"),
            hand_yaw_rad=float(np.radians(_number(content, "hand_yaw_deg"))),
            neutral_rad=_seven(content, "neutral_rad"),
            tip_limits=np.array([_number(content, name) for name in _TIP_LIMITS]),
        )
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def _check_seven(name: str, values: Float64) -> None:
    if values.shape != (JOINTS,) or not np.isfinite(values).all():
        raise UsageError(f"{name} is {shown(values.tolist())}; it must be {JOINTS} finite numbers.")


def _seven(content: dict[Any, Any], name: str) -> Float64:
    values = content.get(name)
    if not isinstance(values, list) or not all(_is_number(value) for value in values):
        raise UsageError(f"{name} is {shown(values)}; it must be a list of {JOINTS} numbers.")
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def _number(content: dict[Any, Any], name: str) -> float:
    if not _is_number(content.get(name)):
        raise UsageError(f"{name} is {shown(content.get(name))}; it must be a number.")
    return float(content[name])


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300
