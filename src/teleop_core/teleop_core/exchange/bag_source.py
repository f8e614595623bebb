"""Bag source: recordings of ROS 1 and 2 whose topics are the motion and the buttons of a hand."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from teleop_core.bags.reader import Bag
from teleop_core.errors import ParameterError, RecordingError, UnknownNameError
from teleop_core.exchange.bag_messages import (
    JOY,
    POSES,
    TRANSFORMS,
    JoyReader,
    PoseReader,
    Raw,
    frames,
    plain,
)
from teleop_core.exchange.options import BUTTONS, ImportOptions, button_map
from teleop_core.exchange.orientation import Attitudes
from teleop_core.exchange.source import Block, Presses
from teleop_core.exchange.tables import first_line
from teleop_core.geometry import Array
from teleop_core.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, Kind

_LOOKED_AT = 1000
"""Messages of transforms whose frames are listed."""
_Damage = (AnyReaderError, SerdeError, OSError, ValueError, KeyError, IndexError, AssertionError,
           EOFError, RuntimeError, NotImplementedError, UnicodeDecodeError)  # fmt: skip
_TABLE_OPTIONS = ("time", "rate", "position", "quaternion", "matrix", "euler", "rotation_vector",
                  "forward", *BUTTONS)  # fmt: skip


class BagSource:
    """A recording of ROS as a source; see :class:`~teleop_core.exchange.source.Source`.

    Args:
        path: Directory of a rosbag2 recording, ``.mcap`` or ``.db3`` file, or ROS 1 ``.bag``.
        options: What is taken of it.

    Raises:
        RecordingError: It cannot be read, or holds no poses.
        ParameterError: Several topics hold poses, or an option does not fit.
        UnknownNameError: The topic or frame is not there.
    """

    has_time, time_unit, bad_rows = True, "ns", 0

    def __init__(self, path: Path, options: ImportOptions) -> None:
        self.path, self._options = path, options
        self.unit = "m" if options.unit == "auto" else options.unit
        self.attitudes = Attitudes("quaternion", "wxyz")
        self.told: list[str] = []
        if given := [name for name in _TABLE_OPTIONS if getattr(options, name)]:
            text = "left out: a recording of ROS has topics, not columns (--topic, --buttons)"
            raise ParameterError(f"--{given[0].replace('_', '-')}", "given", text)
        self._bag = self._our_reader()
        with self._opened() as reader:
            self._types = {
                plain(name): str(info.msgtype)
                for name, info in reader.topics.items()
                if info.msgcount
            }
            self._topic = self._pose_topic()
            self._frame = self._child_frame(reader)
            self._joy = self._joy_topic()
            self._numbers = self._button_numbers(reader)

    def _our_reader(self) -> Bag | None:
        """Our reader of MCAP, which is faster; None for what it does not read."""
        if not _holds(self.path, ".mcap"):
            return None
        with suppress(RecordingError):
            return Bag(self.path)
        return None

    @contextmanager
    def _opened(self) -> Iterator[AnyReader]:
        """Reader of rosbags.

        Raises:
            RecordingError: It cannot be read.
        """
        if self.path.is_dir() and not _holds(self.path, ".mcap", ".db3", ".zstd"):
            reason = "is no recording: it holds no .mcap and no .db3; of ROS 1 give the .bag file"
            raise RecordingError(self.path, reason)
        try:
            types = get_typestore(Stores.ROS2_JAZZY)
            with AnyReader([self.path], default_typestore=types) as reader:
                yield reader
        except RecordingError:
            raise
        except _Damage as error:
            if isinstance(error, ParameterError):  # a ValueError too
                raise
            raise self._refusal(error) from error

    def _refusal(self, error: Exception) -> RecordingError:
        if self._bag is None and _holds(self.path, ".mcap"):
            try:  # our reader's text says what to do about a recording that was cut off
                Bag(self.path)
            except RecordingError as known:
                return known
        return RecordingError(self.path, f"cannot be read: {first_line(error)}")

    # -- which topics ----------------------------------------------------------------------------

    def _pose_topic(self) -> str:
        found = [n for n, kind in self._types.items() if kind in POSES or kind in TRANSFORMS]
        if self._options.topic:
            wanted = plain(self._options.topic)
            if wanted not in self._types:
                raise UnknownNameError("--topic", wanted, sorted(found or self._types))
            if wanted not in found:
                listed = ", ".join(sorted(found)) or "none"
                reason = f"{wanted} is a {self._types[wanted]}, no pose; topics of poses: {listed}"
                raise RecordingError(self.path, reason)
            return wanted
        if not found:
            listed = ", ".join(f"{n} ({kind})" for n, kind in sorted(self._types.items()))
            raise RecordingError(
                self.path, f"holds no topic of poses; it has {listed or 'nothing'}"
            )
        stamped = [name for name in found if self._types[name] not in TRANSFORMS]
        for few in ([n for n in found if n == MASTER_MEASURED_CP.name], found, stamped):
            if len(few) == 1:
                self.told.append(f"poses of {few[0]} ({self._types[few[0]]})")
                return few[0]
        raise UnknownNameError("--topic", "", sorted(found))

    def _child_frame(self, reader: AnyReader) -> str:
        if self._types[self._topic] not in TRANSFORMS:
            return ""
        poses = self._pose_reader(reader)
        known: dict[str, None] = {}
        for number, (_, data) in enumerate(self._raw(reader, self._topic)):
            known |= dict.fromkeys(frames(poses.message(data)))
            if number >= _LOOKED_AT:
                break
        wanted = plain(self._options.frame)
        if not wanted and len(known) == 1:
            wanted = next(iter(known))
            self.told.append(f"transforms of the frame {wanted}")
        if wanted not in known:
            raise UnknownNameError("--frame", wanted, sorted(known))
        return wanted

    def _joy_topic(self) -> str:
        found = [name for name, kind in self._types.items() if kind == JOY]
        if self._options.buttons == "none":
            return ""
        if wanted := plain(self._options.buttons_topic):
            if wanted not in found:
                raise UnknownNameError("--buttons-topic", wanted, sorted(found) or ["none"])
            return wanted
        if MASTER_BUTTONS.name in found or len(found) == 1:
            return MASTER_BUTTONS.name if MASTER_BUTTONS.name in found else found[0]
        if found and self._options.buttons:
            raise UnknownNameError("--buttons-topic", "", sorted(found))
        if found:
            self.told.append(f"no buttons; --buttons-topic takes one of {', '.join(sorted(found))}")
        elif self._options.buttons:
            raise ParameterError("--buttons", self._options.buttons, "left out: there is no Joy")
        return ""

    def _button_numbers(self, reader: AnyReader) -> tuple[int, ...]:
        """Numbers of clutch, fixture and mode among the buttons; -1 for those that are not."""
        if not self._joy:
            return ()
        joy = JoyReader(reader.typestore, is_ros2=reader.is2, numbers=())
        _, first = next(self._raw(reader, self._joy))
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

    def _pose_reader(self, reader: AnyReader) -> PoseReader:
        frame = getattr(self, "_frame", "")
        kind = self._types[self._topic]
        return PoseReader(reader.typestore, kind, is_ros2=reader.is2, frame=frame)

    def _raw(self, reader: AnyReader, topic: str) -> Iterator[Raw]:
        if self._bag is not None:
            for _, _, log, data in self._bag.raw([topic]):
                yield log, data
            return
        chosen = [c for c in reader.connections if plain(c.topic) == topic]
        # There is one file: its own reader need not be merged with others.
        for _, log, data in reader.readers[0].messages(connections=chosen):
            yield log, data

    def blocks(self) -> Iterator[Block]:
        """As of any source.

        Raises:
            RecordingError: The file is damaged.
        """
        if self._bag is not None and self._types[self._topic] == Kind.POSE.ros_type:
            for found in self._bag.blocks([self._topic]):
                if self._topic in found:
                    series = found[self._topic]
                    yield self._block(series.stamp_ns, series.log_ns, series.values)
            return
        with self._opened() as reader:
            poses = self._pose_reader(reader)
            for rows in poses.blocks(self._raw(reader, self._topic)):
                yield self._block(*rows)

    def _block(self, stamps: Any, logs: Any, poses: Array) -> Block:
        quaternions = self.attitudes.quaternions(poses[:, 3:])
        return Block(stamps, poses[:, :3], quaternions, log_ns=logs)

    def presses(self) -> Presses | None:
        """As of any source."""
        if not self._joy:
            return None
        with self._opened() as reader:
            joy = JoyReader(reader.typestore, is_ros2=reader.is2, numbers=self._numbers)
            return Presses(*joy.read(self._raw(reader, self._joy)))

    def check(self, finite: Array) -> None:
        """As of any source."""
        if not finite.all():
            names = np.array(["x", "y", "z", "orientation"])[finite == 0]
            raise RecordingError(self.path, f"{self._topic}: {', '.join(names)} holds no numbers")


def _holds(path: Path, *ends: str) -> bool:
    """Whether a path is, or a directory has, a file with one of these ends."""
    files = path.iterdir() if path.is_dir() else (path,)
    return any(file.suffix in ends for file in files)
