"""Recorded operators: a hand that follows a recording or a table of numbers.

The motion is used unchanged, relative to its first sample. The hand first moves smoothly to ``operator.center``, where
the motion begins; if ``operator.center`` is zero, the motion begins at once. Between samples, position and orientation
are interpolated linearly; during gaps the hand waits.
"""

import warnings
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.base import ParameterError, RecordingError, TeleopWarning, fixed
from teleop_core.graph import topics
from teleop_core.hand.operators import Motion, Operator, Setting
from teleop_core.hand.operators.rest import REST_TILT
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels.geometry import Array, continuous, quaternion_products
from teleop_core.kernels.portable import arctangent, length
from teleop_core.session.master_bag import as_master_bag

COLUMNS = ("t", "x", "y", "z", "rx", "ry", "rz", "clutch", "fixture", "mode")
"""Columns of a table: time [s], position [m], rotation vector [rad], buttons (1 pressed)."""
_PERIODS = 5.0
"""A pause shorter than this number of sample periods is no gap: it is interpolated even if ``longest_gap`` is shorter.
"""


@dataclass(frozen=True, kw_only=True)
class FileParameters:
    """Parameters of a hand that follows a table."""

    path: str = fixed(
        "",
        doc="CSV or Parquet file with a header of t, x, y, z and optionally rx, ry, rz, clutch, "
        "fixture, mode [s, m, rad]",
    )


class Samples(NamedTuple):
    """A recorded hand, relative to its first sample.

    Attributes:
        at: Times (N,) [s] since the first sample.
        moves: Positions (N, 3) [m], in the master's axes.
        turns: Rotations since the first sample, quaternions (N, 4) in the master's axes, without jumps of sign.
        pressed_at: Times (K,) [s] at which buttons change.
        pressed: Values of clutch, fixture and mode (K, 3), each valid from its time in ``pressed_at``.
        closed_at: Times (M,) [s] at which the closing of the jaw changes.
        closed: Closing of the jaw (M, 1), 0 open to 1 closed, each valid from its time in ``closed_at``.
    """

    at: Array
    moves: Array
    turns: Array
    pressed_at: Array
    pressed: Array
    closed_at: Array
    closed: Array


def _bag(parameters: object, setting: Setting) -> Motion:
    """Motion of a recording.

    Raises:
        RecordingError: The recording is missing or contains no motion.
        ParameterError: The recording has several topics of poses.
    """
    return _motion(Path(setting.common.bag), setting)


def _file(parameters: FileParameters, setting: Setting) -> Motion:
    """Motion of a table.

    Raises:
        RecordingError: The file cannot be read, or its numbers are not a valid motion.
        ParameterError: No file is named, or its columns cannot be guessed.
    """
    return _motion(_named(parameters), setting)


def _named(parameters: FileParameters) -> Path:
    if not parameters.path:
        raise ParameterError(
            "operator.file.path", "", "the path of a CSV or Parquet file, because operator.kind is file"
        )
    return Path(parameters.path)


def _bag_length(parameters: object, setting: Setting) -> float:
    """Duration of the approach plus the recording [s]."""
    return _length(samples_of(Path(setting.common.bag)), setting)


def _file_length(parameters: FileParameters, setting: Setting) -> float:
    """Duration of the approach plus the table [s]."""
    return _length(samples_of(_named(parameters)), setting)


def _length(samples: Samples, setting: Setting) -> float:
    return _approach(setting) + float(samples.at[-1])


def _approach(setting: Setting) -> float:
    """Duration of the approach [s]; 0 if ``operator.center`` is zero."""
    return float(setting.common.approach_time) if any(setting.common.center) else 0.0


def samples_of(path: Path) -> Samples:
    """Samples of a recording or table. A warning names everything that was left out or guessed.

    Raises:
        RecordingError: The file cannot be read, or contains no motion.
        ParameterError: The columns or topics of the hand cannot be guessed.
    """
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise RecordingError(path, f"cannot be read: {error.strerror}") from error
    return _read(path, changed)


@lru_cache(maxsize=2)
def _read(path: Path, changed_ns: int) -> Samples:
    bag = as_master_bag(path)
    bag.require((topics.MASTER_MEASURED_CP,))
    series = bag.read(topics.MASTER_MEASURED_CP)
    new = np.concatenate(([True], np.diff(series.stamp_ns) > 0))
    stamps, values = series.stamp_ns[new], series.values[new]
    start_ns, first = int(stamps[0]), values[0, 3:] * (1.0, -1.0, -1.0, -1.0)
    turns = continuous(quaternion_products(values[:, 3:], first), np.array([1.0, 0.0, 0.0, 0.0]))
    at: Array = (stamps - start_ns) * np.float64(1e-9)
    pressed, closed = _changes(bag, topics.MASTER_BUTTONS, start_ns), _changes(bag, topics.HAND_JAW, start_ns)
    return Samples(at, values[:, :3] - values[0, :3], turns, *pressed, *closed)


def _changes(bag: Bag, topic: topics.Topic, start_ns: int) -> tuple[Array, Array]:
    """Times (K,) [s] since a stamp [ns], and values (K, width) of a topic; empty if the bag lacks the topic."""
    if topic.name not in bag.topics or not bag.topics[topic.name].count:
        return np.zeros(0), np.zeros((0, topic.width(0)))
    series = bag.read(topic)
    return (series.stamp_ns - start_ns) * np.float64(1e-9), series.values


def _motion(path: Path, setting: Setting) -> Motion:
    """Motion that first approaches the centre and then follows the samples."""
    samples = samples_of(path)
    _tell_stops(path, samples, setting)
    approach, center = _approach(setting), np.array(setting.common.center)
    period = float(np.median(np.diff(samples.at))) if len(samples.at) > 1 else 0.0
    longest = max(float(setting.common.longest_gap), _PERIODS * period)
    rest = np.array([np.cos(0.5 * REST_TILT), np.sin(0.5 * REST_TILT), 0.0, 0.0])

    def motion(times: Array) -> Array:
        moved = times - approach
        moves, turns = between(samples, moved, longest)
        if approach:
            share = minimum_jerk(times / approach)[:, None]
            moves += share * center
        pressed = held(samples.pressed_at, samples.pressed, moved)
        closed = held(samples.closed_at, samples.closed, moved)
        own = _in_axes_of(rest, turns)
        return np.column_stack((moves, own, pressed, np.zeros_like(moves), closed))

    return motion


def between(samples: Samples, times: Array, longest: float) -> tuple[Array, Array]:
    """Positions (N, 3) [m] and rotations (N, 4), linearly interpolated between samples.

    Before the first sample and after the last sample they are constant. In gaps longer than ``longest`` they keep the
    last sample until the next sample.

    Args:
        samples: The recording.
        times: Times (N,) [s] since the first sample.
        longest: Longest time between two samples that is interpolated [s].
    """
    last = len(samples.at) - 1
    left = np.clip(np.searchsorted(samples.at, times, side="right") - 1, 0, last)
    right = np.minimum(left + 1, last)
    step = samples.at[right] - samples.at[left]
    inside = (times > samples.at[left]) & (step > 0.0) & (step <= longest)
    share = np.where(inside, (times - samples.at[left]) / np.where(step > 0.0, step, 1.0), 0.0)
    share = share[:, None]
    moves = (1.0 - share) * samples.moves[left] + share * samples.moves[right]
    turns = (1.0 - share) * samples.turns[left] + share * samples.turns[right]
    return moves, turns / length(turns)[:, None]


def held(changed_at: Array, values: Array, times: Array) -> Array:
    """Values (N, width) at times (N,) [s], from the latest change at or before each time.

    Values are zero before the first change.

    Args:
        changed_at: Times (K,) of the changes [s].
        values: Values from each change on (K, width).
        times: Times (N,) at which values are wanted [s].
    """
    known = np.vstack((np.zeros(values.shape[1]), values))
    return np.asarray(known[np.searchsorted(changed_at, times, side="right")])


def _in_axes_of(rest: Array, turns: Array) -> Array:
    """Rotation vectors (N, 3) of ``turns`` (N, 4), from the axes of the base to the axes of ``rest``."""
    own = quaternion_products(quaternion_products(rest * (1.0, -1.0, -1.0, -1.0), turns), rest)
    sine = length(own[:, 1:])
    angle = 2.0 * arctangent(sine, own[:, 0])
    return np.asarray(own[:, 1:] * (angle / np.where(sine > 0.0, sine, 1.0))[:, None])


def _tell_stops(path: Path, samples: Samples, setting: Setting) -> None:
    """Warn of a motion that leaves the device's workspace; the warning explains how to keep the motion inside."""
    device = setting.common.device
    size, start = np.array(device.workspace), np.array(device.start)
    places = samples.moves + np.array(setting.common.center) + start  # positions relative to the middle
    beyond = np.abs(places) - 0.5 * size
    is_beyond = (beyond > 0.0).any(axis=1)
    if not is_beyond.any():
        return
    low, high = samples.moves.min(axis=0), samples.moves.max(axis=0)
    hint = f"operator.center={_metres(-start - 0.5 * (low + high))} keeps it within"
    if (high - low > size).any():
        fits = 0.99 * float((size / np.maximum(high - low, 1e-9)).min())
        hint = f"it is {_millimetres(high - low)}: `teleop import --scale {fits:.2g}`"
    share = 100.0 * is_beyond.mean()
    room = f"the device's workspace of {_millimetres(size)}"
    text = f"{share:.3g} % of the motion leaves {room}, by up to {1e3 * beyond.max():.3g} mm"
    warnings.warn(f"{path.name}: {text}; {hint}", TeleopWarning, stacklevel=2)


def _metres(place: Array) -> str:
    return "[" + ",".join(f"{round(value, 4) + 0.0:g}" for value in place.tolist()) + "]"


def _millimetres(size: Array) -> str:
    return " × ".join(f"{1e3 * value:.0f}" for value in size) + " mm"


BAG = Operator("bag", _bag, trembles=True, length=_bag_length)
FILE = Operator("file", _file, FileParameters, length=_file_length)
