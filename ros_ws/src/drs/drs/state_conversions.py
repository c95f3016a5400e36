"""Robot states and targets as standard messages, and back."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, TwistStamped, Vector3
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from drs_core.environments.robot_state import RobotState
from drs_core.errors import UsageError
from drs_core.panda import ARM_JOINTS, FINGER_JOINTS

Float64 = NDArray[np.float64]

_NANOSECONDS = 1_000_000_000
_UNIT_TOLERANCE = 0.01


def stamp(seconds: float) -> Time:
    """Simulated time [s] as a message."""
    total = round(seconds * _NANOSECONDS)
    return Time(sec=total // _NANOSECONDS, nanosec=total % _NANOSECONDS)


def joint_state(
    header: Header, names: tuple[str, ...], positions: Float64, velocities: Float64 | None = None
) -> JointState:
    """Joints in rad (or m), and per second."""
    message = JointState(header=header, name=list(names), position=positions.tolist())
    if velocities is not None:
        message.velocity = velocities.tolist()
    return message


def pose(header: Header, position: Float64, orientation: Float64 | tuple[float, ...]) -> PoseStamped:
    """A position (3,) [m] and an orientation (4,) x, y, z, w."""
    message = PoseStamped(header=header)
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z = map(float, position)
    q.x, q.y, q.z, q.w = map(float, orientation)
    return message


def twist(header: Header, state: RobotState) -> TwistStamped:
    """The tip's velocity [m/s, rad/s]."""
    message = TwistStamped(header=header)
    linear, angular = message.twist.linear, message.twist.angular
    linear.x, linear.y, linear.z = map(float, state.tip_velocity)
    angular.x, angular.y, angular.z = map(float, state.tip_angular_velocity)
    return message


def positions_by_name(message: JointState) -> dict[str, float]:
    """Joint positions by name [rad or m].

    Raises:
        UsageError: names and positions do not go together, or a number is not finite.
    """
    if len(message.name) != len(message.position):
        raise UsageError(f"A joint state has {len(message.name)} names, but {len(message.position)} positions.")
    if not np.isfinite(message.position).all():
        raise UsageError("A joint state has positions that are not finite; it is not used.")
    return dict(zip(message.name, message.position))


def joint_positions(message: JointState, names: tuple[str, ...]) -> Float64:
    """Positions of these joints, in this order, wherever they stand in the message.

    Raises:
        UsageError: one is missing, or not finite.
    """
    known = positions_by_name(message)
    missing = [name for name in names if name not in known]
    if missing:
        raise UsageError(f"A joint state lacks {', '.join(missing)[:200]}.")
    return np.array([known[name] for name in names])


def joint_targets_from_msg(message: JointState, fingers: Float64) -> Float64:
    """A joint_command -> targets (9,): arm [rad], and fingers [m] as they are where it names none.

    Raises:
        UsageError: an arm joint is missing, or a number is not finite.
    """
    known = positions_by_name(message)
    arm = joint_positions(message, ARM_JOINTS)
    return np.concatenate((arm, [known.get(name, fingers[i]) for i, name in enumerate(FINGER_JOINTS)]))


def tip_targets_from_msg(message: PoseStamped, fingers: Float64) -> Float64:
    """A target_pose -> targets (9,): tip position [m], orientation x, y, z, w, fingers [m].

    Raises:
        UsageError: a number is not finite, or the orientation is not a unit quaternion.
    """
    p, q = message.pose.position, message.pose.orientation
    target = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not np.isfinite(target).all():
        raise UsageError("A target pose has values that are not finite; it is not used.")
    if abs(np.linalg.norm(target[3:]) - 1.0) > _UNIT_TOLERANCE:
        raise UsageError(f"A target pose's orientation {target[3:].tolist()} is not a unit quaternion.")
    return np.concatenate((target, fingers))


def position_of(message: PoseStamped) -> Float64:
    """The position of a pose, (3,) [m].

    Raises:
        UsageError: it is not finite.
    """
    return _finite(message.pose.position, "A tip pose has a position")


def velocity_of(message: TwistStamped) -> Float64:
    """The linear velocity of a twist, (3,) [m/s].

    Raises:
        UsageError: it is not finite.
    """
    return _finite(message.twist.linear, "A tip twist has a velocity")


def _finite(vector: Point | Vector3, what: str) -> Float64:
    values = np.array([vector.x, vector.y, vector.z])
    if not np.isfinite(values).all():
        raise UsageError(f"{what} that is not finite; it is not used.")
    return values
