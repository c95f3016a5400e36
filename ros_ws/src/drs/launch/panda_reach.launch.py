"""The graph of a reaching Panda arm: two simulators, tuner and policy node. It only composes."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMS = Path(get_package_share_directory("drs")) / "params" / "panda_reach.yaml"


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch drs panda_reach.launch.py` starts."""
    params = LaunchConfiguration("params")
    tune = ParameterValue(LaunchConfiguration("tune"), value_type=bool)
    return LaunchDescription(
        [
            DeclareLaunchArgument("params", default_value=str(PARAMS), description="parameter file of all nodes"),
            DeclareLaunchArgument("tune", default_value="false", description="tune at once"),
            Node(package="drs", executable="simulator_node", parameters=[params]),
            Node(
                package="drs", executable="simulator_node", name="simulator_2", parameters=[params, {"stream": False}]
            ),
            Node(package="drs", executable="tuner_node", parameters=[params, {"autostart": tune}]),
            Node(package="drs", executable="policy_node", parameters=[params]),
        ]
    )
