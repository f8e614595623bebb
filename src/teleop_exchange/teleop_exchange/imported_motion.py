"""Motion: the cleaned motion of an imported hand, in the master's axes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import ParameterError, RecordingError, damage_told
from teleop_core.kernels import geometry, product
from teleop_exchange import gathering, source, times
from teleop_exchange.options import ImportOptions

if TYPE_CHECKING:
    from teleop_exchange.tables import Table

ROWS = 20_000
"""Number of rows that are rotated at once."""
MOST_BACKWARDS = 0.01
"""Largest share of rows whose time goes back; a file with more is refused."""
MOST_DOUBLED = 0.5


@dataclass(frozen=True)
class Counts:
    """Counts of the rows of a file.

    Attributes:
        rows: Rows in the file.
        samples: Rows that are used.
        missing: Rows left out because a number is missing or NaN, or the orientation is invalid.
        doubled: Rows left out because an earlier row has the same time.
        backwards: Rows whose time went back; left out or sorted in.
        damaged: Rows left out because they have too few or too many cells.
    """

    rows: int
    samples: int
    missing: int
    doubled: int
    backwards: int
    damaged: int


class Motion:
    """Poses of a hand in the master's axes.

    Args:
        path: The file.
        options: Import options.

    Attributes:
        stamp_ns: Times (N,) [ns], rising.
        poses: Position [m] and quaternion w, x, y, z (N, 7).
        counts: Counts of the rows.
        told: Texts about what was used, guessed and changed.
        strange: Number of rows that were left out because their orientation is invalid.
        doubt: Text if another order of a quaternion's columns is more plausible; empty otherwise.
        gaps: Begin and length [s] of each gap, the longest first.

    Raises:
        RecordingError: The file is missing or damaged, or contains no motion. The error is also raised if times go back
            too often or do not change, or if fewer than two rows remain.
        ParameterError: An option is not allowed for this file.
    """

    def __init__(self, path: Path, options: ImportOptions) -> None:
        gathered = gathering.gather(open_source(path, options), options)
        self._path, self._gathered, self._options = path, gathered, options
        self.told, self.strange, self.doubt = list(gathered.told), gathered.strange, gathered.doubt
        usable: NDArray[np.integer] = np.flatnonzero(gathered.is_usable)
        if gathered.order is not None:
            usable = gathered.order[gathered.is_usable[gathered.order]]
        stamps = gathered.stamp_ns[usable]
        self._refuse_several(stamps)
        order = times.ordered(stamps, is_sorted=options.backwards == "sort")
        self._rows = usable[order.rows]
        self.stamp_ns: times.Stamps = stamps[order.rows]
        self.counts = Counts(
            rows=len(gathered.rows) + gathered.bad_rows,
            samples=len(self._rows),
            missing=len(gathered.rows) - len(usable),
            doubled=order.doubled,
            backwards=order.backwards,
            damaged=gathered.bad_rows,
        )
        self._check()
        self.gaps = times.gaps(self.stamp_ns, options.gap)
        self._shift_ns = 0
        self.poses = self._in_axes_of_master(gathered.rows)
        gathered.rows = gathered.rows[:0]

    def _refuse_several(self, stamps: times.Stamps) -> None:
        """Raise an error if a table contains several recordings, because they are not the motion of one hand.

        Raises:
            RecordingError: There are several recordings; the error states where they begin.
        """
        if len(rows := times.restarts(stamps)):
            listed = ", ".join(str(row + 1) for row in rows[:5]) + (", …" if len(rows) > 5 else "")
            reason = f"holds {len(rows) + 1} recordings: the time begins anew in row {listed}"
            raise RecordingError(self._path, f"{reason}; give a file for each, or --stamps log for a bag")

    def _check(self) -> None:
        """Raise an error if the data are not a motion.

        Raises:
            RecordingError: The data are not a motion; the error states the problem.
        """
        c, policy = self.counts, self._options.backwards
        most = {"refuse": 0.0, "auto": MOST_BACKWARDS}.get(policy, 1.0)
        timed = max(1, c.rows - c.missing - c.damaged)
        if c.backwards > most * timed:
            share = 100.0 * c.backwards / timed
            hint = "is --time the right column? Else give --backwards sort or drop"
            raise RecordingError(self._path, f"the time goes back in {c.backwards} rows ({share:.3g} %): {hint}")
        if c.doubled > MOST_DOUBLED * timed:
            share = 100.0 * c.doubled / timed
            hint = "it is too coarse; give --rate HZ, or --stamps log for a bag"
            raise RecordingError(self._path, f"the time does not change in {share:.3g} % of the rows: {hint}")
        if c.samples < 2:
            what = f"{c.samples} usable rows of {c.rows}; a motion needs two"
            raise RecordingError(self._path, f"holds {what}")

    def begin(self, first_ns: int) -> None:
        """Shift all stamps so that a first time [ns] near 0 becomes 1 s.

        If the first time is later, nothing is changed.
        """
        if first_ns >= times.SECOND_NS:
            return
        self.told.append(f"stamps begin at 1 s (in the file at {first_ns / times.SECOND_NS:g} s)")
        self._shift_ns = times.SECOND_NS - first_ns
        self.stamp_ns += self._shift_ns

    def losses(self) -> list[str]:
        """Texts about rows that were left out or changed."""
        c = self.counts
        parts = [
            (c.missing, "with missing numbers left out"),
            (c.doubled, "doubled left out"),
            (c.backwards, "going back in time"),
            (c.damaged, "with a wrong number of cells left out"),
        ]
        return [f"{count} {text}" for count, text in parts if count]

    def _in_axes_of_master(self, rows: geometry.Array) -> geometry.Array:
        """Poses (N, 7) of the used rows in the master's axes, with the centre moved to zero."""
        axes, poses = self._options.axis_map(), np.empty((len(self._rows), 7))
        for begin in range(0, len(poses), ROWS):  # in blocks, because an hour at 1 kHz needs 200 MB
            part = slice(begin, begin + ROWS)
            own = rows[self._rows[part]]
            poses[part, :3] = self._options.scale * product(own[:, :3], axes.T)
            last = poses[begin - 1, 3:] if begin else None
            poses[part, 3:] = geometry.continuous(self._turned(own[:, 3:], axes), last)
        if (name := self._options.center) != "keep":
            place = poses[:, :3]
            low, high = place.min(axis=0), place.max(axis=0)
            centers = {"mean": place.mean(axis=0), "middle": 0.5 * (low + high), "start": place[0]}
            listed = ", ".join(f"{1e3 * value:z.1f}" for value in centers[name])
            self.told.append(f"{name} of the motion at ({listed}) mm brought to zero")
            place -= centers[name].copy()
        return poses

    def _turned(self, quaternions: geometry.Array, axes: geometry.Array) -> geometry.Array:
        """Orientations (n, 4) in the master's axes.

        If the axes of the file are mirrored, the body's axes are also mirrored.
        """
        if self._options.handedness == "right":
            turn = np.empty(4)
            geometry.quaternion_from_rotation(np.ascontiguousarray(axes), turn)
            return geometry.quaternion_products(turn, quaternions)
        # A rotation in the file about an axis is the opposite rotation about the mirrored axis.
        return np.column_stack((quaternions[:, 0], -product(quaternions[:, 1:], axes.T)))

    def closings(self) -> tuple[times.Stamps, geometry.Array] | None:
        """Stamps (n,) [ns] and how far the jaw is closed (n, 1), 0 to 1; None without such a column."""
        closing = self._gathered.closing
        return None if closing is None else (self.stamp_ns, closing[self._rows, None])

    def presses(self) -> tuple[times.Stamps, NDArray[np.uint8]] | None:
        """Stamps (n,) [ns] and buttons (n, 3) at the first sample and at each change; None without buttons."""
        g = self._gathered
        if g.presses is not None:
            stamps, pressed = g.presses.stamp_ns + self._shift_ns, g.presses.pressed
            order = times.ordered(stamps, is_sorted=True)
            stamps, pressed = stamps[order.rows], pressed[order.rows]
        elif g.buttons is not None:
            stamps, pressed = self.stamp_ns, g.buttons[self._rows]
        else:
            return None
        if not len(stamps):
            return None
        changes = np.ones(len(stamps), np.bool_)
        changes[1:] = (pressed[1:] != pressed[:-1]).any(axis=1)
        changes &= stamps >= 0
        return (stamps[changes], pressed[changes]) if changes.any() else None


_BAGS = {".bag", ".mcap", ".db3"}


def is_bag(path: Path) -> bool:
    """Whether a path is a recording of ROS: its directory or its file."""
    return path.is_dir() or path.suffix.lower() in _BAGS


def open_source(path: Path, options: ImportOptions) -> source.Source:
    """Source that reads a file.

    Raises:
        RecordingError: The file is missing, empty, or has an unknown format.
        ParameterError: An option does not fit the file.
    """
    if not path.exists():
        raise RecordingError(path, "does not exist")
    if is_bag(path):
        if options.jaw:
            raise ParameterError("--jaw", options.jaw, "left out for a recording of ROS: only a table has columns")
        from teleop_exchange.bag_source import BagSource

        return BagSource(path, options)
    from teleop_exchange.table_source import TableSource

    return TableSource(open_table(path, options), options)


def open_table(path: Path, options: ImportOptions) -> "Table":
    """Table of a file: Parquet, or text.

    Raises:
        RecordingError: The file cannot be read.
    """
    from teleop_exchange.tables import ParquetTable
    from teleop_exchange.text_table import TextTable

    with damage_told(path), path.open("rb") as file:
        magic = file.read(4)
    return ParquetTable(path) if magic == b"PAR1" else TextTable(path, options.skip)
