"""The graph of a reaching Panda arm: two simulators, tuner and policy node. It only composes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PARAMS = Path(get_package_share_directory("drs")) / "params" / "panda_reach.yaml"


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch drs panda_reach.launch.py` starts."""
    params = LaunchConfiguration("params")

    def node(executable: str, extra: Sequence[dict[str, bool]] = (), **more: Any) -> Node:
        return Node(package="drs", executable=executable, parameters=[params, *extra], output="screen", **more)

    # with the node's name before it, a setting wins over the parameter file's section of that name
    autostart = ["tuner_node:autostart:=", LaunchConfiguration("tune")]
    return LaunchDescription(
        [
            DeclareLaunchArgument("params", default_value=str(PARAMS), description="parameter file of all nodes"),
            DeclareLaunchArgument("tune", default_value="false", description="tune at once"),
            node("simulator_node"),
            node("simulator_node", name="simulator_2", extra=[{"stream": False}]),
            node("tuner_node", arguments=["--ros-args", "-p", autostart]),
            node("policy_node"),
        ]
    )
