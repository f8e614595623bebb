"""Recorded arms: the samples of each arm in a recording, found by their time."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from teleop_console.link import ArmView, ParameterInfo, Setting, ShownArm
from teleop_core.bags.arms import arm_names, of_arm, topic_prefix
from teleop_core.bags.reader import Bag
from teleop_core.bags.reports import read_reports
from teleop_core.bags.series import Series, in_order
from teleop_core.base.errors import RecordingError, TeleopError
from teleop_core.base.parameters import specs, values_of
from teleop_core.graph import topics
from teleop_core.robots import load_robot_set
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import Configuration
from teleop_core.session.runner import recorded_configuration
from teleop_core.slave.operation.report import operation_text

MOST = 200 << 20
"""Largest size of the samples in memory [bytes]; for a longer recording only every second, third, … sample is loaded.
"""
_STAMP_BYTES = 16
_KEPT = (
    *topics.STREAMS,
    topics.SLAVE_MEASURED_CF,
    topics.SLAVE_JAW_MEASURED_JS,
    topics.SLAVE_JAW_OBJECT_CP,
    topics.SLAVE_JAW_BOARD,
    topics.SCENE_POSES,
    topics.MASTER_ENERGY,
    topics.SLAVE_ENERGY,
    topics.TASK_STATE,
)


@dataclass(frozen=True, eq=False)
class RecordedArm:
    """Samples of one arm in memory.

    Attributes:
        arm: The arm.
        tracks: Streams and reports by their names without the arm.
    """

    arm: ShownArm
    tracks: Mapping[str, Series]

    def show(self, time_ns: int, view: ArmView) -> None:
        """Write the values at a time [ns] into an empty view."""
        for name, track in self.tracks.items():
            if (i := track.at(time_ns)) < 0:
                continue
            row = track.values[i]
            if name == topics.TELEOP_STATE.name:
                view.state = dict(zip(topics.TELEOP_STATE.columns, row.tolist(), strict=True))
            elif name == topics.SLAVE_OPERATION.name:
                view.operation = dict(zip(topics.OPERATION, row.tolist(), strict=True))
                view.operation_text = in_words(view.operation, self.arm.robot.joint_names)
            else:
                view.streams[name], view.stamp_ns[name] = row, int(track.stamp_ns[i])


def recorded_arms(
    bag: Bag, configuration: Configuration | None, most: int = MOST
) -> tuple[tuple[RecordedArm, ...], int]:
    """All arms of a recording, the default arm first, and the thinning n: every n-th sample is loaded.

    Args:
        bag: The recording.
        configuration: Configuration of the recorded session; None if unknown.
        most: Largest size of the samples in memory [bytes].

    Raises:
        RecordingError: The recording lacks the robot's name or its joint positions.
    """
    bags = {name: of_arm(bag, arm) for name, arm in namespaces(bag).items()}
    arms = [ShownArm(name, _robot(one, configuration, name)) for name, one in bags.items()]
    thinning = max(1, -(-sum(_size(bags[arm.name], arm.robot.n) for arm in arms) // most))
    found = [RecordedArm(arm, _tracks(bags[arm.name], arm, thinning)) for arm in arms]
    return tuple(found), thinning


def namespaces(bag: Bag) -> dict[str, str]:
    """Namespaces of all arms; the default arm, whose topics have no prefix, has an empty namespace."""
    return {name if topic_prefix(bag, name).endswith(f"{name}/") else "": name for name in arm_names(bag)}


def configuration_of(bag: Bag) -> Configuration | None:
    """Configuration of the recorded session; None if there is none, or if this version cannot build it."""
    with suppress(TeleopError):
        layer, scenario = recorded_configuration(bag)
        return Configuration.from_layers([layer], scenario) if layer else None
    return None


def _robot(bag: Bag, configuration: Configuration | None, arm: str) -> Robot:
    """Robot of one arm.

    Raises:
        RecordingError: The recording does not name the robot, or its joints were not recorded.
    """
    name = bag.metadata.get("robot", "")
    geometry: tuple[str, ...] = ()
    if configuration is not None and arm in configuration.graph.namespaces:
        name = str(configuration.value("robot", arm) or name)
        geometry = tuple(configuration.value("geometry", arm) or ())
    if not name:
        missing = "does not name its robot, like recordings of other systems"
        cure = "`teleop import` makes a recording of the hand that can be replayed"
        raise RecordingError(bag.path, f"{missing}; {cure}")
    try:
        robot = load_robot_set(name, geometry)
    except (TeleopError, OSError) as error:
        raise RecordingError(bag.path, f"its robot cannot be loaded: {error}") from error
    bag.require([topics.SLAVE_MEASURED_JS])
    return robot


def _size(bag: Bag, joints: int) -> int:
    """Size of the samples of one arm [bytes]."""
    infos = [(topic, bag.topics.get(topic.name)) for topic in _KEPT]
    widths = {topic.name: topic.width(joints) for topic in _KEPT}
    return sum(info.count * (8 * widths[topic.name] + _STAMP_BYTES) for topic, info in infos if info is not None)


def _tracks(bag: Bag, arm: ShownArm, thinning: int) -> dict[str, Series]:
    """Streams and reports of one arm by their names without the arm."""
    wanted = [
        topic
        for topic in _KEPT
        if (info := bag.topics.get(topic.name)) is not None and info.count and info.type == topic.kind.ros_type
    ]
    parts: dict[str, list[Series]] = {topic.name: [] for topic in wanted}
    joints = {topic.name for topic in wanted if topic.kind.has_joints}
    seen = dict.fromkeys(parts, 0)
    for block in bag.blocks(wanted):
        for name, series in block.items():
            begin = -seen[name] % thinning
            seen[name] += len(series)
            chosen = slice(begin, None, thinning)
            logs, stamps = series.log_ns[chosen].copy(), series.stamp_ns[chosen].copy()
            rows = series.values[chosen].copy()
            if name in joints:
                rows = rows[:, _order(bag, series.names, rows.shape[1], arm.robot)]
            parts[name].append(Series(stamps, logs, rows))
    tracks = {name: in_order(found) for name, found in parts.items() if found}
    for topic in (topics.TELEOP_STATE, topics.SLAVE_OPERATION):
        if (found := reports_of(bag, topic)) is not None:
            tracks[topic.name] = found
    return tracks


def _order(bag: Bag, names: tuple[str, ...], width: int, robot: Robot) -> list[int] | slice:
    """Indices of the columns, with joints in the robot's order; a topic without joints keeps its order.

    Raises:
        RecordingError: Joints of the robot were not recorded.
    """
    if names == robot.joint_names:
        return slice(None)
    if missing := [name for name in robot.joint_names if name not in names]:
        reason = f"lacks joints {', '.join(missing)} of {robot.name}; it has {', '.join(names)}"
        raise RecordingError(bag.path, reason)
    chosen = [names.index(name) for name in robot.joint_names]
    return [part * len(names) + joint for part in range(width // len(names)) for joint in chosen]


def reports_of(bag: Bag, topic: topics.Topic) -> Series | None:
    """Numbers of a report, with the columns that the recording contains; None without any column."""
    info = bag.topics.get(topic.name)
    if info is None or not info.count or info.type != topic.kind.ros_type:
        return None
    logs, stamps, rows = [], [], []
    for _, _, log_ns, data in bag.raw([topic]):
        with suppress(ValueError):  # the bytes may not be a report
            for report in read_reports(data):
                rows.append([float(report.values.get(c, "nan")) for c in topic.columns])
                logs.append(log_ns)
                stamps.append(report.stamp_ns)
    if not rows:
        return None
    return Series(np.array(stamps, np.int64), np.array(logs, np.int64), np.array(rows))


def in_words(operation: Mapping[str, float], joints: tuple[str, ...]) -> str:
    """Text with the state of the arm; empty for numbers of another version."""
    with suppress(ValueError, KeyError):
        return operation_text(operation, joints)
    return ""


def parameters_of(
    configuration: Configuration | None, only: tuple[str, ...] = ()
) -> dict[tuple[str, str], ParameterInfo]:
    """Parameters of groups with their declarations, by node and name; all of them are marked as fixed.

    Args:
        configuration: Configuration of the session; None returns no parameters.
        only: Names of the groups to return; empty for all.
    """
    found = {}
    groups: dict[str, Any] = {} if configuration is None else configuration.groups
    for node, group in groups.items():
        if only and node not in only:
            continue
        values = values_of(group)
        for spec in specs(type(group)):
            if spec.name in values:
                doc = f"{spec.doc} [{spec.unit}]" if spec.unit else spec.doc
                value = cast("Setting", values[spec.name])
                found[node, spec.name] = ParameterInfo(
                    node, spec.name, value, doc, spec.lowest, spec.upper, spec.choices, is_fixed=True
                )
    return found
