"""Frames: the numbers of a recording at the rate of a data set, of this package's topics or of any others."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import messages
from teleop_core.bags.arms import topic_prefix
from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.series import Series
from teleop_core.base import RecordingError, UnknownNameError, damage_told
from teleop_core.graph.topics import (
    SLAVE_JAW_OBJECT_CP,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SERVO_JP,
    TASK_STATE,
    Kind,
    Topic,
)
from teleop_core.session.recording import Recording, open_recording
from teleop_exchange.bag_messages import plain
from teleop_exchange.joining import Streams
from teleop_exchange.ros_bags import OurBag, RosBag, is_plain_mcap, opened_by_rosbags
from teleop_exchange.times import Stamps

STATE, ACTION = "observation.state", "action"
SURROUNDINGS = "observation.environment_state"
"""Feature with the goal of the task and the pose of the object. Policies such as ACT need this feature or pictures."""
ACTIONS = {"joints": SLAVE_SERVO_JP, "tip": SLAVE_SERVO_CP}
_GOAL = ("goal_x", "goal_y", "goal_z", "goal_qw", "goal_qx", "goal_qy", "goal_qz", "width")
_AROUND: dict[Topic, tuple[str, ...]] = {TASK_STATE: _GOAL, SLAVE_JAW_OBJECT_CP: ()}  # all columns of the pose
_TIPS = {SLAVE_MEASURED_CP.name: "tip.", SLAVE_SERVO_CP.name: "tip.", SLAVE_JAW_OBJECT_CP.name: "object."}
_COMMAND = re.compile(r"command|cmd|action|goal|target|desired|servo|leader|setpoint|reference")
_JOINTS = Kind.JOINTS.ros_type
_KINDS = {kind.ros_type: kind for kind in (Kind.POSE, Kind.TWIST, Kind.WRENCH, Kind.STATE)}
_NUMBERS = {
    *_KINDS, "geometry_msgs/msg/Pose", "geometry_msgs/msg/Twist", "geometry_msgs/msg/Wrench",
    "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/TransformStamped", "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/Float32MultiArray", "std_msgs/msg/Float64", "std_msgs/msg/Float32", "sensor_msgs/msg/Joy",
    "trajectory_msgs/msg/JointTrajectoryPoint",
}  # fmt: skip


@dataclass(frozen=True)
class Part:
    """A topic whose columns belong to a feature.

    Attributes:
        feature: Name of the feature.
        topic: Name of the topic.
        label: Text before the names of the columns.
        columns: Wanted columns; empty for all but velocities and efforts of joints.
    """

    feature: str
    topic: str
    label: str
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Frames:
    """Numbers of an episode.

    Attributes:
        time_ns: Time of each frame (n,) [ns], by the clock of the recording.
        names: Names of the columns of each feature.
        numbers: Columns (n, width) of each feature.
    """

    time_ns: Stamps
    names: dict[str, list[str]]
    numbers: dict[str, NDArray[np.float32]]

    def since(self, first: int) -> "Frames":
        """The frames from a number on."""
        return Frames(self.time_ns[first:], self.names, {key: found[first:] for key, found in self.numbers.items()})


@contextmanager
def opened(recording: Recording | Path) -> Iterator[RosBag | None]:
    """A recording message by message; None if it is in memory.

    Raises:
        RecordingError: The recording cannot be read.
    """
    if isinstance(recording, Recording):
        yield None if isinstance(recording.bag, MemoryBag) else OurBag(recording.bag)
        return
    with damage_told(recording), opened_by_rosbags(recording) as bag:
        yield bag


def open_any(path: Path | str) -> Recording | Path:
    """A recording of MCAP, opened; the path of a recording in another storage, which :func:`opened` opens.

    Raises:
        RecordingError: The recording does not exist or cannot be read.
    """
    path = Path(path)
    if not path.exists() or is_plain_mcap(path) or not (path.is_dir() or path.suffix in {".db3", ".bag"}):
        recording = open_recording(path)
        return path if recording.bag.is_ros1 else recording
    return path


def around(recordings: Sequence[Recording | Path]) -> list[Topic]:
    """Topics of a task and of an object that every arm of every recording has."""
    ours = [one for one in recordings if isinstance(one, Recording)]
    return [topic for topic in _AROUND if len(ours) == len(recordings) and all(_has(one, topic) for one in ours)]


def _has(recording: Recording, topic: Topic) -> bool:
    names = [topic_prefix(recording.bag, arm) + topic.name for arm in recording.arms]
    return all(name in recording.bag.topics and recording.bag.topics[name].count for name in names)


def frames_of(
    recording: Recording | Path, fps: int, state: Sequence[str], action: Sequence[str], surroundings: Sequence[Topic]
) -> Frames:
    """Frames of a recording, each with the newest message of each topic, from the first time at which all are known.

    Args:
        recording: A recording, or the path of one in another storage than MCAP.
        fps: Frames per second.
        state: Topics of ``observation.state``; empty for the slave's joints and tip, or for guessed topics.
        action: ``joints``, ``tip``, or topics.
        surroundings: Topics of ``observation.environment_state``.

    Raises:
        RecordingError: A topic is missing, or there is no time at which all topics are known.
    """
    is_plain = not state and list(action) in [[name] for name in ACTIONS]
    if isinstance(recording, Recording) and is_plain and (_has(recording, SLAVE_MEASURED_JS) or recording.metadata):
        return _sampled(recording, _parts_of_ours(recording, ACTIONS[action[0]], surroundings), fps)
    named = () if list(action) in [[name] for name in ACTIONS] else action
    where = recording if isinstance(recording, Path) else recording.bag.path
    if isinstance(recording, Recording):
        types = {name: info.type for name, info in recording.bag.topics.items() if info.count}
        parts = _parts_of_others(where, types, state, named)
        if all(types[part.topic] in _KINDS for part in parts):
            return _sampled(recording, parts, fps)
    with opened(recording) as bag:
        assert bag is not None  # all topics of a recording in memory have a kind
        parts = _parts_of_others(where, bag.types, state, named)
        series = dict(_series(bag, part.topic) for part in parts)
        return _sampled(Recording(MemoryBag(str(where), series, {}, {})), parts, fps)


def _parts_of_ours(recording: Recording, told: Topic, surroundings: Sequence[Topic]) -> list[Part]:
    parts = []
    for arm in recording.arms:
        prefix = topic_prefix(recording.bag, arm)
        measured = ((STATE, SLAVE_MEASURED_JS), (STATE, SLAVE_MEASURED_CP))
        for key, topic in (*measured, *((SURROUNDINGS, topic) for topic in surroundings), (ACTION, told)):
            label = prefix + _TIPS.get(topic.name, "")
            parts.append(Part(key, prefix + topic.name, label, _AROUND.get(topic, ())))
    recording.bag.require([part.topic for part in parts])
    return sorted(parts, key=lambda part: (STATE, SURROUNDINGS, ACTION).index(part.feature))


def _parts_of_others(where: Path, types: Mapping[str, str], state: Sequence[str], action: Sequence[str]) -> list[Part]:
    """Topics of a recording of another writer: those that are named, else joint states, and commands by their names."""
    known = [name for name, kind in types.items() if kind in _NUMBERS]
    commands = [name for name in known if _COMMAND.search(name.lower())]
    joints = [name for name in known if types[name] == _JOINTS and name not in commands]
    chosen = {
        STATE: _named("--state", types, state) or joints or [name for name in known if name not in commands],
        ACTION: _named("--action", types, action) or commands,
    }
    if missing := [option for key, option in ((STATE, "--state"), (ACTION, "--action")) if not chosen[key]]:
        listed = ", ".join(sorted(known)) or "none"
        reason = f"lacks {SLAVE_MEASURED_JS.name} and {SLAVE_SERVO_JP.name}; topics for {missing[0]}: {listed}"
        raise RecordingError(where, reason)
    return [
        Part(key, name, "" if len(names) == 1 else f"{name.replace('/', '.')}.")
        for key, names in chosen.items()
        for name in names
    ]


def _named(option: str, types: Mapping[str, str], topics: Sequence[str]) -> list[str]:
    names = [plain(name) for name in topics]
    if unknown := [name for name in names if name not in types]:
        known = [*ACTIONS, *sorted(types)] if option == "--action" else sorted(types)
        raise UnknownNameError(option, unknown[0], known)
    return names


def _series(bag: RosBag, name: str) -> tuple[Topic, Series]:
    """All messages of a topic as numbers.

    Raises:
        RecordingError: The messages hold no numbers, or their count changes.
    """
    kind = _KINDS.get(bag.types[name])
    read = bag.typestore.deserialize_cdr if bag.is_ros2 else bag.typestore.deserialize_ros1
    logs, rows, names = list[int](), list[NDArray[np.float64]](), tuple[str, ...]()
    for log, data in bag.raw(name):
        message = read(data, bag.types[name])
        if kind is None:
            flat = dict(_flat(message))
            names = names or tuple(flat)
            row: Any = np.array([flat.get(one, np.nan) for one in names])
        else:
            names = names or tuple(getattr(message, "name", ()))
            row = messages.read_values(kind, message, names)
            row = row if isinstance(row, messages.Refusal) else row[1]
        if isinstance(row, messages.Refusal):
            continue
        logs.append(log)
        rows.append(row)
    if not rows or not len(rows[0]):
        raise RecordingError(name, f"contains {bag.types[name]} without numbers")
    log_ns, order = np.array(logs, np.int64), np.argsort(logs, kind="stable")
    values = np.array(rows)[order]
    return Topic(name, kind or Kind.JOINTS), Series(log_ns[order], log_ns[order], values, names)


def _flat(message: Any, before: str = "") -> Iterator[tuple[str, float]]:
    """Names and values of all numbers in a message, without its header."""
    if isinstance(message, Real):
        yield before.removesuffix("."), float(message)
    elif isinstance(message, np.ndarray | list):
        for i, one in enumerate(message):
            yield from _flat(one, f"{before}{i}.")
    elif hasattr(message, "__dataclass_fields__"):
        for name in message.__dataclass_fields__:
            if name not in {"header", "layout", "__msgtype__"}:
                yield from _flat(getattr(message, name), f"{before}{name}.")


def _sampled(recording: Recording, parts: Sequence[Part], fps: int) -> Frames:
    streams = Streams(recording, [part.topic for part in parts])
    pieces = list(streams.sampled(fps))
    names: dict[str, list[str]] = {part.feature: [] for part in parts}
    found: dict[str, list[NDArray[np.float64]]] = {part.feature: [] for part in parts}
    for part in parts:
        columns = [c for c in streams.columns[part.topic] if not c.endswith((".velocity", ".effort"))]
        if part.columns:
            columns = [c for c in columns if c.removesuffix(".position") in part.columns]
        at = [streams.columns[part.topic].index(column) for column in columns]
        found[part.feature].append(np.concatenate([piece.values[part.topic][:, at] for piece in pieces]))
        names[part.feature] += [part.label + column.removesuffix(".position") for column in columns]
    numbers = {key: np.hstack(columns).astype(np.float32) for key, columns in found.items()}
    times = np.concatenate([piece.time_ns for piece in pieces])
    return Frames(times, names, numbers).since(_first(np.hstack(list(numbers.values())), recording))


def _first(rows: NDArray[np.float32], recording: Recording) -> int:
    is_known = np.isfinite(rows).all(axis=1)
    if not is_known.any():
        raise RecordingError(recording.bag.path, "has no time at which all topics of the data set are known")
    return int(is_known.argmax())
