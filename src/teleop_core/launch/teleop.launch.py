"""The whole graph on a full ROS 2 installation: ``ros2 launch teleop_core teleop.launch.py``."""

import tempfile
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from teleop_core.nodes.live import parameter_file
from teleop_core.session.configuration import configure
from teleop_core.session.graph import STAGES

ARGUMENTS = {
    "scenario": ("coarse_box", "one of `teleop scenarios`"),
    "params_file": ("", "ROS 2 parameter file over the scenario"),
    "record": ("true", "whether the recorder runs"),
    "out": ("", "directory of the recording; empty: bags/ and the time"),
}


def nodes(context: LaunchContext) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    files = [Path(given["params_file"])] if given["params_file"] else []
    configuration = configure(given["scenario"], files)
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
        file.write(parameter_file(configuration, given["out"]))
    is_recorded = given["record"].lower() in {"true", "1", "yes"}
    return [
        Node(
            package="teleop_core", executable=stage.name, name=stage.name, output="screen",
            parameters=[file.name],
        )
        for stage in reversed(STAGES)
        if is_recorded or stage.name != "recorder"
    ]  # fmt: skip


def generate_launch_description() -> LaunchDescription:
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
