"""Master bag: converts any recording into a recording whose master motion can be replayed or followed by an operator.

Valid recordings are used unchanged. Other recordings, and tables, are converted by an installed reader.
"""

from importlib.metadata import entry_points
from pathlib import Path

import numpy as np

from teleop_core.bags import memory, messages, reader
from teleop_core.base.errors import RecordingError
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, Kind
from teleop_core.kernels.portable import length

READERS = "teleop_core.readers"
"""Entry-point group of functions ``reader(path, bag, prefixes)``: see :func:`as_master_bag`."""


def as_master_bag(recording: Path | str | reader.Bag) -> reader.Bag:
    """Recording with ``master/measured_cp`` of its arms, and ``master/buttons`` if the recording contains buttons.

    A warning names everything that had to be guessed, changed or left out.

    Args:
        recording: An open recording, or its path. If ``teleop_exchange`` is installed, the recording may also be a ROS
            1, CSV or Parquet file, use other topics, or contain damaged rows.

    Returns:
        The recording itself if it is valid, else a copy of these topics in memory, with the same stamps and metadata.

    Raises:
        RecordingError: The recording cannot be read, contains no motion, or needs a reader that is not installed.
        ParameterError: The recording has several topics of poses.
    """
    if isinstance(recording, memory.MemoryBag):
        return recording
    path = recording.path if isinstance(recording, reader.Bag) else Path(recording)
    ours = recording if isinstance(recording, reader.Bag) else _ours(path)
    prefixes = [] if ours is None else _prefixes(ours)
    if ours is not None and prefixes and all(is_sound(ours, prefix) for prefix in prefixes):
        return ours
    for entry in entry_points(group=READERS):
        found: reader.Bag = entry.load()(path, ours, prefixes)
        return found
    reason = "contains no valid motion of a master; install teleop_exchange, which reads other recordings"
    raise RecordingError(path, reason)


def _ours(path: Path) -> reader.Bag | None:
    """The recording as opened by this package; None if the file has another format."""
    if not path.exists() or not (path.is_dir() or path.suffix == ".mcap"):
        return None
    try:
        return reader.Bag(path)
    except RecordingError:
        return None


def _prefixes(bag: reader.Bag) -> list[str]:
    """Prefix before ``master/measured_cp``, for each arm that has such poses."""
    name, kind = MASTER_MEASURED_CP.name, MASTER_MEASURED_CP.kind.ros_type
    ends = [n for n, info in bag.topics.items() if info.count and info.type == kind]
    return [n.removesuffix(name) for n in ends if n == name or n.endswith(f"/{name}")]


def is_sound(bag: reader.Bag, prefix: str) -> bool:
    """Whether an arm's poses and buttons can be used unchanged.

    Poses must be finite and have unit quaternions and increasing stamps. Buttons must be three, and their stamps must
    not decrease.
    """
    last, first = -1, -1
    name = prefix + MASTER_MEASURED_CP.name
    for block in bag.blocks([name]):
        if (series := block.get(name)) is None or not len(series):
            continue
        lengths = length(series.values[:, 3:])
        first = int(series.stamp_ns[0]) if first < 0 else first
        is_rising = series.stamp_ns[0] >= last and (np.diff(series.stamp_ns) >= 0).all()
        is_unit = (np.abs(lengths - 1.0) <= messages.QUATERNION_TOLERANCE).all()  # False for NaN
        if not (is_rising and is_unit and np.isfinite(series.values[:, :3]).all()):
            return False
        last = int(series.stamp_ns[-1])
    is_one = bag.topics[name].count == 1
    return (last > first or is_one) and _are_sound(bag, prefix + MASTER_BUTTONS.name, first, last)


def _are_sound(bag: reader.Bag, name: str, first: int, last: int) -> bool:
    """Whether buttons can be used unchanged with poses from ``first`` to ``last`` [ns]; True if there are no buttons.

    Buttons whose stamps are all outside of this time were stamped by another clock.
    """
    info = bag.topics.get(name)
    if info is None or not info.count:
        return True
    if info.type != Kind.BUTTONS.ros_type:
        return False
    try:
        stamps = bag.read(name).stamp_ns
    except RecordingError:  # the messages do not have three buttons
        return False
    if len(stamps) > 1 and (stamps[0] == stamps[-1] or stamps[-1] < first or stamps[0] > last):
        return False
    return bool((np.diff(stamps) >= 0).all())
