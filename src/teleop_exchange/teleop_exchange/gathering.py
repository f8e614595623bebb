"""Gathering: reads all rows of a source, with their times and a mask of usable rows."""

import math
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import RecordingError
from teleop_core.base.ranges import check
from teleop_core.kernels.geometry import Array
from teleop_exchange.options import LENGTHS, TIMES_NS, ImportOptions
from teleop_exchange.source import Presses, Source
from teleop_exchange.times import LARGEST_LAG_NS, SECOND_NS, Stamps, clock_offset, guessed_unit, is_constant, joined_ns

SAMPLE = 1000
"""Largest number of times per block, and largest number of blocks, from which the unit is guessed."""
MOST_STRANGE = 0.01
"""Largest share of rows with an invalid orientation; a file with more is refused."""
TOLD_LENGTH = 1e-3
"""Largest difference of a quaternion's length from 1 that is not reported."""
_NO_TIME = np.iinfo(np.int64).min
FARTHEST = 5.0
"""Largest plausible coordinate of a hand [m]. For larger values an option or the file must state that the unit is
metres."""


@dataclass(eq=False)
class Gathered:
    """A file after the first pass.

    Attributes:
        rows: Rows (N, 7): position [m] in the file's axes, quaternion w, x, y, z.
        stamp_ns: Times (N,) [ns]; rows without a time are not usable.
        is_usable: Whether all values of a row are numbers (N,).
        buttons: Whether each button is pressed (N, 3), one row for each pose; None without such columns.
        presses: Buttons with their own times; None if there are none.
        told: Texts about what was used and guessed.
        bad_rows: Number of damaged rows that the source left out.
        strange: Number of orientations that are not valid rotations.
        order: Indices of the rows in the order of recording (N,); None if this is the order of the file.
        closing: How far the jaw is closed (N,), 0 to 1; None without such a column.
        doubt: Text if another order of a quaternion's columns is more plausible; empty otherwise.
    """

    rows: Array
    stamp_ns: Stamps
    is_usable: NDArray[np.bool_]
    buttons: NDArray[np.uint8] | None
    presses: Presses | None
    told: list[str]
    bad_rows: int
    strange: int
    order: NDArray[np.int32] | None = None
    doubt: str = ""
    closing: Array | None = None


@dataclass(eq=False)
class _Parts:
    """Data that are collected block by block."""

    rows: list[Array]
    times: list[NDArray[np.float64] | Stamps]
    logs: list[Stamps]
    usable: list[NDArray[np.bool_]]
    buttons: list[NDArray[np.uint8]]
    finite: NDArray[np.float64]
    closing: list[Array]
    farthest: float = 0.0


def gather(source: Source, options: ImportOptions) -> Gathered:
    """Read all of a source.

    Raises:
        RecordingError: The source contains no rows or an empty column, or its orientations are invalid. Also if
            positions are far beyond a hand's reach and no unit is stated.
    """
    parts = _Parts([], [], [], [], [], np.zeros(4), [])
    scale = LENGTHS[source.unit]
    for block in source.blocks():
        rows = np.column_stack((scale * block.position, block.quaternion))
        parts.rows.append(rows)
        is_number: NDArray[np.bool_] = np.isfinite(rows)
        parts.finite += [*is_number[:, :3].sum(axis=0), is_number[:, 3:].all(axis=1).sum()]
        sizes = np.abs(rows[:, :3][is_number[:, :3]])
        parts.farthest = max(parts.farthest, float(sizes.max(initial=0.0)))
        parts.usable.append(np.asarray(is_number.all(axis=1)))
        parts.times.append(block.time)
        if block.log_ns is not None:
            parts.logs.append(block.log_ns)
        if block.closing is not None:
            parts.closing.append(block.closing)
        if block.buttons is not None:
            parts.buttons.append(block.buttons)
    count = sum(map(len, parts.rows))
    if not count:
        raise RecordingError(source.path, "holds no rows")
    _check(source, parts, count)
    told = list(source.told)
    if source.attitudes.longest > TOLD_LENGTH:
        told.append(f"quaternions up to {source.attitudes.longest:.2g} off unit length made unit")
    order = _recorded_order(parts.logs)
    stamps, usable, is_log = _stamps(source, options, parts, told)
    presses = source.presses()
    if presses is not None and parts.logs:
        presses = _of_one_clock(presses, stamps[usable], np.concatenate(parts.logs)[usable], is_log, told)
    buttons = np.concatenate(parts.buttons) if parts.buttons else None
    strange = source.attitudes.strange
    rows = np.concatenate(parts.rows)
    if count > 1 and not usable.any():
        _refuse_broken_rows(source, rows, stamps)
    return Gathered(
        rows,
        stamps,
        usable,
        buttons,
        presses,
        told,
        source.bad_rows,
        strange,
        order,
        source.attitudes.doubt,
        _filled(source, parts.closing),
    )


def _filled(source: Source, parts: list[Array]) -> Array | None:
    """How far the jaw is closed in each row; a missing value repeats the one before it.

    Raises:
        RecordingError: The column of the jaw contains no numbers.
    """
    if not parts:
        return None
    whole = np.concatenate(parts)
    known = np.flatnonzero(np.isfinite(whole))
    if not len(known):
        raise RecordingError(source.path, "the column of --jaw holds no numbers")
    before = np.searchsorted(known, np.arange(len(whole)), side="right") - 1
    return np.asarray(whole[known[np.maximum(before, 0)]])


def _refuse_broken_rows(source: Source, rows: Array, stamps: Stamps) -> NoReturn:
    """Refuse rows of which none is whole, and tell what is missing in which share of them."""
    is_number = np.isfinite(rows)
    known = (stamps != _NO_TIME, is_number[:, :3].all(axis=1), is_number[:, 3:].all(axis=1))
    missing = [
        f"{label} in {100.0 * (1.0 - own.mean()):.3g} %"
        for label, own in zip(source.labels, known, strict=True)
        if not own.all()
    ]
    hint = "--orientation none imports the positions alone" if (known[0] & known[1]).any() else "choose other columns"
    what = f"holds 0 usable rows of {len(rows)}: numbers are missing of {', of '.join(missing)} of them"
    raise RecordingError(source.path, f"{what}, and of something in each; {hint}")


def _of_one_clock(presses: Presses, stamps: Stamps, logs: Stamps, is_log: bool, told: list[str]) -> Presses:
    """Buttons at times of the clock that stamped the poses.

    Args:
        presses: The buttons.
        stamps: Times of the poses (n,) [ns].
        logs: Times of recording of the poses (n,) [ns].
        is_log: Whether the times of the poses are those of recording.
        told: Texts, to which a text is added if the buttons have another clock.
    """
    if is_log or is_constant(presses.stamp_ns):
        offset = 0 if is_log else clock_offset(stamps, logs)
    else:
        offset = clock_offset(stamps, logs)
        apart = abs(offset - clock_offset(presses.stamp_ns, presses.log_ns))
        if apart < LARGEST_LAG_NS or is_constant(logs) or not _overlap(presses.log_ns, logs):
            return presses
        what = f"buttons are stamped by another clock, {apart / SECOND_NS:.4g} s apart"
        told.append(f"{what}: their times of recording are taken, and brought to the clock of the poses")
    return Presses(presses.log_ns + offset, presses.log_ns, presses.pressed)


def _overlap(one: Stamps, other: Stamps) -> bool:
    """Whether the spans of some times overlap."""
    return len(one) > 0 and len(other) > 0 and one.min() <= other.max() and other.min() <= one.max()


def _recorded_order(logs: list[Stamps]) -> NDArray[np.int32] | None:
    """Indices of the rows in the order of their times of recording (N,); None if they already have this order.

    Files of several writers, and splits that are listed in another order, may have any order.
    """
    whole = np.concatenate(logs) if logs else np.zeros(0, np.int64)
    if (whole[1:] >= whole[:-1]).all():
        return None
    return np.argsort(whole, kind="stable").astype(np.int32)


def _check(source: Source, parts: _Parts, count: int) -> None:
    """Refuse data that are not a motion.

    Raises:
        RecordingError: The data are not a motion; the error states the problem.
    """
    attitudes = source.attitudes
    if attitudes.strange > MOST_STRANGE * count:
        share = 100.0 * attitudes.strange / count
        hint = "give --orientation none" if parts.logs else _hint(attitudes.kind, attitudes.mirrored)
        raise RecordingError(source.path, f"{_strange(attitudes.kind)} in {share:.3g} % of the rows: {hint}")
    source.check(parts.finite)
    check("farthest place from the origin", parts.farthest, "m")
    if parts.farthest > FARTHEST and not source.is_unit_said:
        reason = (
            f"places are up to {parts.farthest:,.4g} m from the origin, if they are in metres; say "
            "their unit: --unit mm, or --unit m if they are"
        )
        raise RecordingError(source.path, reason)


def _strange(kind: str) -> str:
    if kind == "matrix":
        return "the matrix is no rotation (off by more than 0.1, or a mirror)"
    return "the quaternion is not of unit length (off by more than 0.1)"


def _hint(kind: str, mirrored: int) -> str:
    if kind == "matrix" and mirrored:
        return "are the columns of --matrix in order, row by row? A mirror changes handedness"
    name = "--matrix" if kind == "matrix" else "--quaternion and their order"
    return f"check the columns of {name}, or give --orientation none"


def _stamps(
    source: Source, options: ImportOptions, parts: _Parts, told: list[str]
) -> tuple[Stamps, NDArray[np.bool_], bool]:
    """Times [ns] of all rows, which rows are usable, and whether these are times of recording."""
    usable = np.concatenate(parts.usable)
    if not source.has_time:
        assert options.rate is not None
        told.append(f"times from the rate of {options.rate:g} Hz")
        steps = np.arange(len(usable)) * (SECOND_NS / options.rate)
        return np.rint(steps).astype(np.int64), usable, False
    if parts.logs and options.stamps == "log":
        told.append("stamps: time of recording")
        return np.concatenate(parts.logs), usable, True
    is_bag = bool(parts.logs)  # in a bag, a stamp of zero means a missing stamp
    known = [part[np.isfinite(part) & ((part != 0) | (not is_bag))] for part in parts.times]
    first = next((float(part[0]) for part in known if len(part)), 0.0 if is_bag else math.nan)
    if math.isnan(first):
        raise RecordingError(source.path, "the column of the time contains no numbers")
    if all((part == first).all() for part in known) and len(usable) > 1:
        return _without_stamps(source, parts, first, told), usable, True
    unit = source.time_unit
    if unit == "auto":
        unit, reason = guessed_unit(_few(known))
        if "tick" in source.labels[0].lower() and unit in TIMES_NS:
            unit, reason = "", "ticks may be of any length"
        if not unit:
            raise RecordingError(source.path, f"has times of an unknown unit: {reason}; give --time-unit, or --rate HZ")
        told.append(f"times in {unit}" + (f" ({reason})" if reason else ""))
    del known
    stamps = joined_ns(parts.times, unit, _NO_TIME)
    if (stamps == _NO_TIME).all():
        reason = f"its times are {first:g} {unit} and so on, after 2038; give another --time-unit, or --rate HZ"
        raise RecordingError(source.path, reason)
    usable &= (stamps != _NO_TIME) & ((stamps != 0) | (not is_bag))
    return stamps, usable, False


def _without_stamps(source: Source, parts: _Parts, value: float, told: list[str]) -> Stamps:
    """Times of recording, used instead of times that are all equal.

    Raises:
        RecordingError: There are no times of recording.
    """
    if not parts.logs:
        reason = f"the time is {value:g} in every row; choose another --time, or give --rate HZ"
        raise RecordingError(source.path, reason)
    stamp = f"{value / SECOND_NS:g} s"
    told.append(f"header stamps are all {stamp}: the time of recording is taken")
    return np.concatenate(parts.logs)


def _few(parts: list[NDArray[np.float64] | Stamps]) -> NDArray[np.float64]:
    """Text with a few of the times in order, for a message."""
    return np.concatenate([part[:SAMPLE] for part in parts[:SAMPLE]], dtype=np.float64)
