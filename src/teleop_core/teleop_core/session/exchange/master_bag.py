"""Master bag: any recording as one whose masters can be replayed and followed.

Recordings that are sound are taken as they are. Of others a copy in memory is made: of another
topic or message of the pose, stamps that say nothing, buttons of another Joy, damaged rows.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.messages import QUATERNION_TOLERANCE
from teleop_core.bags.reader import Bag
from teleop_core.bags.series import Series
from teleop_core.base.errors import RecordingError, TeleopError, TeleopWarning
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, Kind, Topic
from teleop_core.kernels.portable import length
from teleop_core.session.exchange.imported_motion import Motion
from teleop_core.session.exchange.options import ImportOptions
from teleop_core.session.exchange.spool import Spool
from teleop_core.session.exchange.times import is_constant


def as_master_bag(recording: Path | str | Bag, options: ImportOptions | None = None) -> Bag:
    """Recording with ``master/measured_cp`` of its arms, and ``master/buttons`` where it has some.

    What had to be guessed, changed or left out is told as a warning.

    Args:
        recording: A recording, opened or where it is: rosbag2, ROS 1, CSV or Parquet.
        options: What is taken of a recording of others.

    Returns:
        The recording itself if it has what is needed, else a copy in memory of these topics, with
        the same stamps and metadata.

    Raises:
        RecordingError: It cannot be read, or holds no motion.
        ParameterError: It has several topics of poses.
    """
    if isinstance(recording, MemoryBag):
        return recording
    path = recording.path if isinstance(recording, Bag) else Path(recording)
    ours = recording if isinstance(recording, Bag) else _ours(path)
    prefixes = [] if ours is None else _prefixes(ours)
    if ours is not None and prefixes and all(is_sound(ours, prefix) for prefix in prefixes):
        return ours
    wanted = options or ImportOptions()
    series: dict[Topic, Series] = {}
    for prefix in prefixes or [""]:
        chosen = wanted if ours is None else _of_arm(ours, prefix, wanted)
        series |= _read(path, prefix.rstrip("/"), chosen)
    return MemoryBag(str(path), series, {}, {} if ours is None else ours.metadata)


def _ours(path: Path) -> Bag | None:
    """The recording as we read it; None for other files."""
    if not path.exists() or not (path.is_dir() or path.suffix == ".mcap"):
        return None
    try:
        return Bag(path)
    except RecordingError:
        return None


def _prefixes(bag: Bag) -> list[str]:
    """What stands before ``master/measured_cp`` of each arm that has such poses."""
    name, kind = MASTER_MEASURED_CP.name, MASTER_MEASURED_CP.kind.ros_type
    ends = [n for n, info in bag.topics.items() if info.count and info.type == kind]
    return [n.removesuffix(name) for n in ends if n == name or n.endswith(f"/{name}")]


def is_sound(bag: Bag, prefix: str) -> bool:
    """Whether an arm's poses and buttons can be taken as they are.

    Poses are finite, of unit quaternions, and their stamps do not go back or stand still; buttons
    are three, and their stamps do not go back.
    """
    last, first = -1, -1
    name = prefix + MASTER_MEASURED_CP.name
    for block in bag.blocks([name]):
        if (series := block.get(name)) is None or not len(series):
            continue
        lengths = length(series.values[:, 3:])
        first = int(series.stamp_ns[0]) if first < 0 else first
        is_rising = series.stamp_ns[0] >= last and (np.diff(series.stamp_ns) >= 0).all()
        is_unit = (np.abs(lengths - 1.0) <= QUATERNION_TOLERANCE).all()  # NaN is not
        if not (is_rising and is_unit and np.isfinite(series.values[:, :3]).all()):
            return False
        last = int(series.stamp_ns[-1])
    is_one = bag.topics[name].count == 1
    return (last > first or is_one) and _are_sound(bag, prefix + MASTER_BUTTONS.name)


def _are_sound(bag: Bag, name: str) -> bool:
    """Whether buttons can be taken as they are; true if there are none."""
    info = bag.topics.get(name)
    if info is None or not info.count:
        return True
    if info.type != Kind.BUTTONS.ros_type:
        return False
    try:
        stamps = bag.read(name).stamp_ns
    except RecordingError:  # more or fewer buttons
        return False
    return not is_constant(stamps) and bool((np.diff(stamps) >= 0).all())


def _of_arm(bag: Bag, prefix: str, options: ImportOptions) -> ImportOptions:
    """Options that take an arm's topics, where it has them and nothing else is wanted."""
    poses, buttons = prefix + MASTER_MEASURED_CP.name, prefix + MASTER_BUTTONS.name
    topic = options.topic or (poses if poses in bag.topics else "")
    known = bag.topics.get(buttons)
    is_joy = known is not None and known.count and known.type == Kind.BUTTONS.ros_type
    return replace(
        options, topic=topic, buttons_topic=options.buttons_topic or (buttons if is_joy else "")
    )


def _read(path: Path, arm: str, options: ImportOptions) -> dict[Topic, Series]:
    """Streams of one arm."""
    with Spool(7) as spool, _options_told(path):
        motion = Motion(path, options, spool)
        blocks = [poses for _, poses in motion.blocks()]
        presses = motion.presses()
    stamps, poses = motion.stamp_ns, np.concatenate(blocks)
    topic = MASTER_MEASURED_CP.of_arm(arm)
    found = {topic: Series(stamps, stamps, poses, (), topic.frame_id)}
    if presses is not None:
        topic = MASTER_BUTTONS.of_arm(arm)
        at, pressed = presses
        found[topic] = Series(at, at, pressed.astype(np.float64), (), topic.frame_id)
    if notes := [*motion.told, *motion.losses()]:
        warnings.warn(f"{path.name}: {'; '.join(notes)}", TeleopWarning, stacklevel=4)
    return found


@contextmanager
def _options_told(path: Path) -> Iterator[None]:
    """Say whose options those are that an error advises: who plays a recording takes none."""
    try:
        yield
    except TeleopError as error:
        if "--" in str(error):
            error.args = (f"{error} (an option of `teleop import {path} --out DIR`)",)
        raise
