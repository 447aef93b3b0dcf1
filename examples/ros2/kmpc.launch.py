"""Start the node: ros2 launch ./kmpc.launch.py model:=robot.npz radius:=0.2 v_max:=0.3."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

DEFAULTS = {"model": "''", "radius": "0.2", "v_max": "0.3", "omega_max": "0.8"}


def generate_launch_description():
    node = Node(
        executable=sys.executable,
        arguments=[str(Path(__file__).parent / "kmpc_node.py")],
        parameters=[{name: LaunchConfiguration(name) for name in DEFAULTS}],
        output="screen",
    )
    given = [DeclareLaunchArgument(name, default_value=text) for name, text in DEFAULTS.items()]
    return LaunchDescription([*given, node])
