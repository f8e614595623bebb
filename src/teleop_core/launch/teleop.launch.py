"""The whole graph on a full ROS 2 installation: ``ros2 launch teleop_core teleop.launch.py``."""

import tempfile
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from teleop_core.graph import RECORDER_NAME
from teleop_core.nodes.live import parameter_file
from teleop_core.session.configuration import configure

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
    graph = configuration.graph
    names = [member.name for member in reversed(graph.members)]
    if is_recorded:
        names.insert(0, RECORDER_NAME)
    return [_node(name, file.name) for name in names]


def _node(name: str, file: str) -> Node:
    """A member of the graph in the namespace of its arm."""
    arm, _, stage = name.rpartition("/")
    return Node(
        package="teleop_core", executable="stage", arguments=[stage], name=stage, namespace=arm,
        output="screen", parameters=[file],
    )  # fmt: skip


def generate_launch_description() -> LaunchDescription:
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
