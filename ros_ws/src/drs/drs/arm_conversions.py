"""What an arm's drivers publish as inputs of serving, and its commands as messages."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from drs_core.serving.inputs import JointSample, PoseSample
from drs_core.serving.motion import Motion


def seconds(stamp: Any) -> float:
    """A time stamp in s."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def joint_sample(message: JointState) -> JointSample:
    """Joint states as they came; what is wrong with them is for the guards to find."""
    return JointSample(message.name, message.position, message.velocity, seconds(message.header.stamp))


def pose_sample(message: PoseStamped) -> PoseSample:
    """A pose as it came."""
    p, q = message.pose.position, message.pose.orientation
    stamp_s = seconds(message.header.stamp)
    return PoseSample(message.header.frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w), stamp_s)


def trajectory(header: Header, joints: tuple[str, ...], motion: Motion, period_s: float) -> JointTrajectory:
    """One point, to be reached within one period.

    Positions alone: a JointTrajectoryController refuses a last point that moves.
    """
    nanoseconds = round(1e9 * period_s)
    point = JointTrajectoryPoint(
        positions=motion.positions.tolist(),
        time_from_start=Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9),
    )
    # a stamp of zero means: from now on
    return JointTrajectory(header=Header(frame_id=header.frame_id), joint_names=list(joints), points=[point])
