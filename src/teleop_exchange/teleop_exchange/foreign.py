"""Foreign: reads recordings of other programs, for ``replay`` and for the operators ``bag`` and ``file``.

The recording is copied into memory in four cases: the topic or type of the pose differs from ours, the stamps are
useless, the buttons are in another Joy message, or rows are damaged.
"""

import csv
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from teleop_core.bags import memory, reader
from teleop_core.bags.series import Series
from teleop_core.base import RecordingError, TeleopError, TeleopWarning, damage_told
from teleop_core.graph import topics
from teleop_core.session.recorded_hand import COLUMNS
from teleop_exchange.imported_motion import Motion
from teleop_exchange.options import ImportOptions

_NAMED = ("rotation vector =", "angles in radians")
"""Notes on the columns of turns in a table of an operator."""


def master_of_others(path: Path, bag: reader.Bag | None, prefixes: Sequence[str]) -> memory.MemoryBag:
    """Copy of the master's topics in memory, with the same stamps and metadata.

    Args:
        path: A recording or table.
        bag: The opened recording, if its format is that of this package.
        prefixes: Prefix before ``master/measured_cp`` for each arm of the recording.

    Raises:
        RecordingError: The file cannot be read, or contains no motion.
        ParameterError: The file has several topics of poses.
    """
    wanted = columns_of(path)
    series: dict[topics.Topic, Series] = {}
    for prefix in prefixes or [""]:
        chosen = wanted if bag is None else _of_arm(bag, prefix, wanted)
        series |= _read(path, prefix.rstrip("/"), chosen)
    return memory.MemoryBag(str(path), series, {}, {} if bag is None else bag.metadata)


def columns_of(path: Path) -> ImportOptions:
    """Options for the columns of a table whose columns are named as in a file of an operator.

    The columns of other files are guessed.
    """
    if path.suffix.lower() != ".csv" or not path.is_file():
        return ImportOptions()
    try:
        with damage_told(path), path.open(newline="", encoding="utf-8") as file:
            head = [name.strip() for name in next(csv.reader(file), [])]
    except RecordingError:  # the code that reads the whole file reports the error
        return ImportOptions()
    if not set(COLUMNS[:4]) <= set(head) <= set(COLUMNS):
        return ImportOptions()
    is_turned = set(COLUMNS[4:7]) <= set(head)  # read as a rotation vector, unless it is in degrees by its size
    return ImportOptions(
        time=COLUMNS[:1], time_unit="s", position=COLUMNS[1:4], unit="m", orientation="auto" if is_turned else "none"
    ).changed(**{name: name for name in COLUMNS[7:] if name in head})


def _of_arm(bag: reader.Bag, prefix: str, options: ImportOptions) -> ImportOptions:
    """Options that choose an arm's topics, if they exist and no option chooses others."""
    poses, buttons = prefix + topics.MASTER_MEASURED_CP.name, prefix + topics.MASTER_BUTTONS.name
    topic = options.topic or (poses if poses in bag.topics else "")
    known = bag.topics.get(buttons)
    is_joy = known is not None and known.count and known.type == topics.Kind.BUTTONS.ros_type
    return replace(options, topic=topic, buttons_topic=options.buttons_topic or (buttons if is_joy else ""))


def _read(path: Path, arm: str, options: ImportOptions) -> dict[topics.Topic, Series]:
    with _options_told(path):
        motion = Motion(path, options)
    presses, stamps = motion.presses(), motion.stamp_ns
    topic = topics.MASTER_MEASURED_CP.of_arm(arm)
    found = {topic: Series(stamps, stamps, motion.poses, (), topic.frame_id)}
    if presses is not None:
        topic = topics.MASTER_BUTTONS.of_arm(arm)
        at, pressed = presses
        found[topic] = Series(at, at, pressed.astype(np.float64), (), topic.frame_id)
    # Columns that the head names in full are no guess, and need no note.
    notes = [note for note in motion.told if options.position != COLUMNS[1:4] or not note.startswith(_NAMED)]
    if notes := [*notes, *motion.losses()]:
        warnings.warn(f"{path.name}: {'; '.join(notes)}", TeleopWarning, stacklevel=4)
    return found


@contextmanager
def _options_told(path: Path) -> Iterator[None]:
    """Add to an error that its advice refers to options of ``teleop import``; a replay has no such options."""
    try:
        yield
    except TeleopError as error:
        if "--" in str(error):
            error.args = (f"{error} (an option of `teleop import {path} --out DIR`)",)
        raise
