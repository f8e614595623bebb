"""Bag source: recordings of ROS 1 and 2 with topics for the motion and the buttons of a hand."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from teleop_core.bags.finding import METADATA
from teleop_core.bags.reader import Bag
from teleop_core.base import ParameterError, RecordingError, UnknownNameError, damage_told
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array
from teleop_exchange import orientation, ros_bags, source
from teleop_exchange.bag_messages import JOY, POSES, TRANSFORMS, Frames, JoyReader, PoseReader, Rows, plain
from teleop_exchange.options import BUTTONS, ORIENTATIONS, ImportOptions, button_map, option
from teleop_exchange.transform_chain import chain_to, composed

_TABLE_OPTIONS = (*ORIENTATIONS, "time", "rate", "position", *BUTTONS, "episode", "numbered_by", "skip")
_TABLE_CHOICES = ("time_unit", "quaternion_order", "matrix_order", "angles")


class BagSource:
    """A recording of ROS as a source; see :class:`~teleop_exchange.source.Source`.

    Args:
        path: Directory of a rosbag2 recording, ``.mcap`` or ``.db3`` file, or ROS 1 ``.bag``.
        options: Import options.

    Raises:
        RecordingError: The recording cannot be read, or contains no poses.
        ParameterError: Several topics contain poses, or an option does not fit.
        UnknownNameError: The topic or frame does not exist.
    """

    has_time, time_unit, bad_rows, is_unit_said = True, "ns", 0, True
    labels = ("stamps", "positions", "orientations")

    def __init__(self, path: Path, options: ImportOptions) -> None:
        self.path, self._options = path, options
        self.unit = "m" if options.unit == "auto" else options.unit
        is_constant = options.orientation == "none"
        self.attitudes = orientation.Attitudes("none" if is_constant else "quaternion", "wxyz")
        self.told: list[str] = ["orientation: constant"] * is_constant
        given = [name for name in _TABLE_OPTIONS if getattr(options, name) not in {None, (), "", 0}]
        given += [name for name in _TABLE_CHOICES if getattr(options, name) != getattr(ImportOptions, name)]
        if given:
            text = "left out: a recording of ROS has topics, not columns (--topic, --buttons)"
            raise ParameterError(option(given[0]), "given", text)
        self._bag = Bag(path) if ros_bags.is_plain_mcap(path) else None
        with self._opened() as bag:
            self._types = bag.types
            transforms = [name for name, kind in self._types.items() if kind in TRANSFORMS]
            self._static = [name for name in transforms if name.endswith("tf_static")]
            self._topic = self._pose_topic()
            self._frame = plain(options.frame)
            self._chain = self._way(bag)
            self._joy = self._joy_topic()
            self._numbers = self._button_numbers(bag)

    @contextmanager
    def _opened(self) -> Iterator[ros_bags.RosBag]:
        """Open the recording for reading message by message.

        Raises:
            RecordingError: The recording cannot be read.
        """
        with damage_told(self.path):
            if self._bag is not None:
                yield ros_bags.OurBag(self._bag)
                return
            if self.path.is_dir():
                _refuse_folder(self.path)
            with ros_bags.opened_by_rosbags(self.path) as bag:
                yield bag

    # -- which topics ----------------------------------------------------------------------------

    def _pose_topic(self) -> str:
        found = [n for n, kind in self._types.items() if kind in POSES or kind in TRANSFORMS]
        if not self._options.topic:  # static transforms only complete other transforms
            found = [name for name in found if name not in self._static] or found
        if self._options.topic:
            wanted = _named(self._options.topic, self._types)
            if wanted is None:
                named = plain(self._options.topic)
                raise UnknownNameError("--topic", named, sorted(found or self._types))
            if wanted not in found:
                listed = ", ".join(sorted(found)) or "none"
                reason = f"{wanted} is a {self._types[wanted]}, no pose; topics of poses: {listed}"
                raise RecordingError(self.path, reason)
            return wanted
        if not found:
            listed = ", ".join(f"{n} ({kind})" for n, kind in sorted(self._types.items()))
            raise RecordingError(self.path, f"holds no topic of poses; it has {listed or 'nothing'}")
        stamped = [name for name in found if self._types[name] not in TRANSFORMS]
        for few in ([n for n in found if n == topics.MASTER_MEASURED_CP.name], found, stamped):
            if len(few) == 1:
                self.told.append(f"poses of {few[0]} ({self._types[few[0]]})")
                return few[0]
        raise UnknownNameError("--topic", "", sorted(found))

    def _way(self, bag: ros_bags.RosBag) -> list[tuple[str, Frames]]:
        """Chain of transforms from the wanted frame up to the wanted parent frame, each with its topic.

        The parent must be named if a frame has several parents. The result is empty if the topic alone is sufficient.

        Raises:
            UnknownNameError: There are several frames or parents, and no option chooses one.
        """
        if self._types[self._topic] not in TRANSFORMS:
            return []
        known: dict[Frames, str] = {}
        for topic in (*self._static, self._topic):
            known |= dict.fromkeys(self._pose_reader(bag, topic).frames(bag.raw(topic)), topic)
        parents: dict[str, set[str]] = {}
        for parent, child in known:
            parents.setdefault(child, set()).add(parent)
        if not self._frame and len(parents) == 1:
            (self._frame,) = parents
        if self._frame not in parents:
            raise UnknownNameError("--frame", self._frame, sorted(parents))
        way = chain_to(plain(self._options.parent), self._frame, parents)
        if len(way) == 1 and known.get(way[0]) in {None, self._topic}:
            return []
        return [(known[e], e if len(parents[e[1]]) > 1 else ("", e[1])) for e in way]

    def _joy_topic(self) -> str:
        found = [name for name, kind in self._types.items() if kind == JOY]
        if self._options.buttons == "none":
            return ""
        if given := self._options.buttons_topic:
            wanted = _named(given, found)
            if wanted is None:
                raise UnknownNameError("--buttons-topic", plain(given), sorted(found) or ["none"])
            return wanted
        if topics.MASTER_BUTTONS.name in found or len(found) == 1:
            return topics.MASTER_BUTTONS.name if topics.MASTER_BUTTONS.name in found else found[0]
        if found and self._options.buttons:
            raise UnknownNameError("--buttons-topic", "", sorted(found))
        if found:
            self.told.append(f"no buttons; --buttons-topic takes one of {', '.join(sorted(found))}")
        elif self._options.buttons:
            raise ParameterError("--buttons", self._options.buttons, "left out: there is no Joy")
        return ""

    def _button_numbers(self, bag: ros_bags.RosBag) -> tuple[int, ...]:
        """Indices of clutch, fixture and mode among the buttons; -1 for missing buttons."""
        if not self._joy:
            return ()
        joy = JoyReader(bag.typestore, is_ros2=bag.is_ros2, numbers=())
        _, first = next(bag.raw(self._joy))
        count = len(joy.message(first).buttons)
        named = button_map(self._options.buttons) if self._options.buttons else {}
        named = named or {name: i for i, name in enumerate(BUTTONS) if i < count}
        if beyond := [number for number in named.values() if number >= count]:
            needed = f"below {count}, the number of buttons of {self._joy}"
            raise ParameterError("--buttons", beyond[0], needed)
        listed = ", ".join(f"{name} = {number}" for name, number in named.items())
        self.told.append(f"buttons of {self._joy}: {listed or 'none'}")
        return tuple(named.get(name, -1) for name in BUTTONS)

    # -- messages --------------------------------------------------------------------------------

    def _pose_reader(self, bag: ros_bags.RosBag, topic: str, frame: str = "", parent: str = "") -> PoseReader:
        kind = self._types[topic]
        return PoseReader(bag.typestore, kind, is_ros2=bag.is_ros2, frame=frame, parent=parent)

    def _composed(self, bag: ros_bags.RosBag) -> Rows:
        edges, told = [], []
        top = ""
        for topic, (parent, child) in self._chain:
            reader = self._pose_reader(bag, topic, child, parent)
            parts = list(reader.blocks(bag.raw(topic)))
            edges.append(Rows(*map(np.concatenate, zip(*parts, strict=True))))
            top, count = (reader.taken or (parent, child))[0], len(edges[-1].poses)
            told.append(f"{child} in {top} ({count if count > 1 else 'constant'})")
        found = composed(edges, by_log=self._options.stamps == "log")
        ends = f"poses of {self._frame} in {top or 'a frame without a name'}"
        self.told.append(f"{ends}, composed of {', '.join(told)}")
        if early := max(len(edge.poses) for edge in edges) - len(found.poses):
            self.told.append(f"{early} poses before the first of all of these are left out")
        return found

    def blocks(self) -> Iterator[source.Block]:
        """All rows in the order of the file.

        Raises:
            RecordingError: The file is damaged.
            UnknownNameError: The poses have several frames, and no frame or an unknown frame is chosen.
        """
        with self._opened() as bag:
            if self._chain:
                yield self._block(*self._composed(bag))
                return
            parent = plain(self._options.parent)
            poses = self._pose_reader(bag, self._topic, self._frame, parent)
            for rows in poses.blocks(bag.raw(self._topic)):
                yield self._block(*rows)
        parent, child = poses.taken or ("", "")
        if poses.taken is None:
            chosen = f"--frame {self._frame or '(any)'} in --parent {self._options.parent or '(any)'}"
            raise RecordingError(self.path, f"{self._topic} contains no pose of {chosen}")
        if child:
            self.told.append(f"poses of {child} in {parent or 'a frame without a name'}")

    def _block(self, stamps: Any, logs: Any, poses: Array) -> source.Block:
        quaternions = self.attitudes.quaternions(poses[:, 3:])
        return source.Block(stamps, poses[:, :3], quaternions, log_ns=logs)

    def presses(self) -> source.Presses | None:
        """Buttons with their own stream; None if there are none. Must be called after the blocks were read."""
        if not self._joy:
            return None
        with self._opened() as bag:
            joy = JoyReader(bag.typestore, is_ros2=bag.is_ros2, numbers=self._numbers)
            stamps, logs, pressed = joy.read(bag.raw(self._joy))
        order = np.argsort(logs, kind="stable")
        return source.Presses(stamps[order], logs[order], pressed[order])

    def check(self, finite: Array) -> None:
        """Raise an error if a column contains no number."""
        if not finite.all():
            names = np.array(["x", "y", "z", "orientation"])[finite == 0]
            hint = "; give --orientation none" * (list(names) == ["orientation"])
            raise RecordingError(self.path, f"{self._topic}: {', '.join(names)} holds no numbers{hint}")


def _named(wanted: str, names: Iterable[str]) -> str | None:
    """Return the topic with the wanted name, or the only topic whose name ends with the wanted name.

    For ``a|b``, the result is the first existing topic; None if neither exists.
    """
    known = list(names)
    for name in map(plain, wanted.split("|")):
        ends = [one for one in known if name and f"/{one}".endswith(f"/{name}")]
        if name in known or len(ends) == 1 or ("|" in wanted and not name):
            return name if name in known or not name else ends[0]
    return None


def _refuse_folder(path: Path) -> None:
    """Refuse a folder that is no recording of ROS 2, with what to give instead.

    Raises:
        RecordingError: The folder holds no files of messages, or no ``metadata.yaml`` that lists them.
    """
    files = sorted(file.name for file in path.iterdir() if not file.name.startswith("."))
    messages = [name for name in files if Path(name.removesuffix(".zstd")).suffix in {".db3", ".mcap"}]
    if not messages:
        hint = "of ROS 1 give the .bag file; of a data set give --episode all"
        raise RecordingError(path, f"is no recording: it holds no .mcap and no .db3; {hint}")
    if METADATA not in files:
        packed = [name for name in messages if name.endswith(".zstd")]
        first = f"unpack its files by `zstd -d {packed[0]}`, " if packed else f"give one of its files ({messages[0]}), "
        remedy = f"{first}or have the list made by `ros2 bag reindex {path}`"
        raise RecordingError(path, f"lacks {METADATA}, which lists its files: {remedy}")
