"""Start the node: ros2 launch ./kmpc.launch.py model:=robot.npz radius:=0.2 v_max:=0.3."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

DEFAULTS = {"model": "robot.npz", "radius": "0.2", "v_max": "0.3", "params": "kmpc.yaml"}


def generate_launch_description():
    given = [DeclareLaunchArgument(name, default_value=text) for name, text in DEFAULTS.items()]
    model, radius, v_max, params = (LaunchConfiguration(name) for name in DEFAULTS)
    driving = ["--model", model, "--radius", radius, "--v-max", v_max]
    ros = ["--ros-args", "--params-file", params]
    node = ExecuteProcess(cmd=["kmpc", "ros2", *driving, *ros], output="screen")
    return LaunchDescription([*given, node])
