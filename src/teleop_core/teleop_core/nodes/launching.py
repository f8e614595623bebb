"""Launching: the processes that the launch files start, as plain values, and their description for ``launch``.

``launch`` is not on PyPI. It is imported only when a description is made, on a full ROS 2.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError
from teleop_core.base.plain_yaml import written
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.files import temporary_file
from teleop_core.nodes.live import session_parameters
from teleop_core.nodes.start import SESSION
from teleop_core.session.configuration import configure

if TYPE_CHECKING:
    from launch import LaunchDescription

LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")
COMMON = {
    "scenario": ("coarse_box", "one of `teleop scenarios`"),
    "params_file": ("", "ROS 2 parameter file over the scenario"),
    "namespace": ("", "where all nodes and topics are, below that of an including launch file"),
    "processes": ("sides", "sides: the hand's and the slave's; nodes: one each; one: for all"),
    "record": ("true", "whether the recorder records from the start"),
    "out": ("", "directory of the recording; empty: bags/ and the time"),
    "respawn": ("true", "whether a process that ends is started again; never that of the slave or the recorder"),
    "log_level": ("info", "one of " + ", ".join(LOG_LEVELS)),
}
"""Arguments of all launch files: default and meaning of each name."""
ONE_ARM = {"robot": ("", "robot of the arm, one of `teleop parts`; empty: the scenario's")}
TWO_ARMS = {
    "left_robot": ("", "robot of the default arm, whose topics have no arm's name"),
    "right_robot": ("", "robot of the further arm, whose topics are below right/"),
}


_ONCE = (RECORDER_NAME, "slave", "slave_sim")
"""Nodes that are not restarted: an existing recording is not changed, and an arm that failed must not move again by
itself."""
_RESPAWN_DELAY = 2.0


@dataclass(frozen=True)
class LaunchedProcess:
    """One process to start.

    Attributes:
        executable: Executable of this package.
        arguments: Arguments before the ROS arguments.
        name: Name of the node; empty if the process contains several nodes.
        namespace: Namespace of the process, with leading slash.
        parameters: Parameter file, kept until the launching process ends.
        log_level: Lowest level of the log.
        respawns: Whether the process is restarted when it ends.
    """

    executable: str
    arguments: tuple[str, ...]
    name: str
    namespace: str
    parameters: str
    log_level: str
    respawns: bool = False


def processes(given: Mapping[str, str], namespace: str = "") -> list[LaunchedProcess]:
    """Processes of a session. The recorder is the first and masters are the last, so that no message is missed.

    Args:
        given: Arguments by name, as in :data:`COMMON` and in the arguments of one launch file.
        namespace: Namespace of an including launch file.

    Raises:
        TeleopError: An argument is wrong.
    """
    where = "/".join(part.strip("/") for part in (namespace, given["namespace"]) if part.strip("/"))
    files = [Path(given["params_file"])] if given["params_file"] else []
    configuration = configure(given["scenario"], files, _settings(given))
    level = given["log_level"].lower()
    if level not in LOG_LEVELS:
        raise ParameterError("log_level", given["log_level"], f"one of {', '.join(LOG_LEVELS)}")
    is_recorded = _truth("record", given["record"])
    text = written(session_parameters(configuration, given["out"], where, starts_recorder=is_recorded))
    file = temporary_file(text)
    if given["processes"] not in set(Processes):
        raise ParameterError("processes", given["processes"], f"one of {', '.join(Processes)}")
    recorder, shared = crews(configuration.graph, Processes(given["processes"]))
    found = []
    for nodes in [*recorder.values()] * is_recorded + [*reversed(shared.values())]:
        stages = {full.rpartition("/")[2] for full in nodes}
        arm, _, stage = nodes[0].rpartition("/")
        below = "/".join(filter(None, (where, arm if len(nodes) == 1 else "")))
        respawns = _truth("respawn", given["respawn"]) and not stages & {*_ONCE}
        name, executable = (stage, "stage") if len(nodes) == 1 else ("", SESSION)
        words = (stage,) if len(nodes) == 1 else nodes
        found.append(LaunchedProcess(executable, words, name, f"/{below}", file, level, respawns))
    return found


def _settings(given: Mapping[str, str]) -> list[str]:
    arms = {"robot": "robot", "left_robot": "left/robot", "right_robot": "right/robot"}
    found = ["teleop.arms=[left, right]"] if "left_robot" in given else []
    return found + [f"{key}={given[name]}" for name, key in arms.items() if given.get(name)]


def _truth(name: str, text: str) -> bool:
    word = text.lower()
    if word not in {"true", "false", "1", "0", "yes", "no"}:
        raise ParameterError(name, text, "true or false")
    return word in {"true", "1", "yes"}


def describe(own: Mapping[str, tuple[str, str]]) -> "LaunchDescription":
    """Description of a launch file.

    Args:
        own: Arguments of this launch file in addition to :data:`COMMON`: default and meaning of each name.
    """
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch_ros.actions import Node

    from launch import LaunchDescription

    arguments = {**COMMON, **own}

    def nodes(context: Any) -> list[Node]:
        given = {name: context.launch_configurations[name] for name in arguments}
        outer = context.launch_configurations.get("ros_namespace", "")
        return [_action(Node, process) for process in processes(given, outer)]

    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in arguments.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])


def _action(node: Any, process: LaunchedProcess) -> Any:
    return node(
        package="teleop_core",
        executable=process.executable,
        arguments=[*process.arguments],
        exec_name=process.name or process.executable,
        name=process.name or None,
        namespace=process.namespace,
        parameters=[process.parameters],
        respawn=process.respawns,
        respawn_delay=_RESPAWN_DELAY,
        output="screen",
        ros_arguments=["--log-level", process.log_level],
    )
