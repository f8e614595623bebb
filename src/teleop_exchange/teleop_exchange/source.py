"""Source: what an import reads, poses and buttons of a hand block by block."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array
from teleop_exchange import orientation, times


@dataclass(frozen=True, eq=False)
class Block:
    """Rows as they stand in a file.

    Attributes:
        time: Times (n,) in the file's unit; NaN where there is none.
        position: Rows (n, 3) in the file's unit and axes.
        quaternion: Attitudes (n, 4), w, x, y, z; NaN where there is none.
        buttons: Pressed or not (n, 3): clutch, fixture, mode; None if there are no columns of them.
        log_ns: Times of recording (n,) [ns], for bags.
    """

    time: Array | times.Stamps
    position: Array
    quaternion: Array
    buttons: NDArray[np.uint8] | None = None
    log_ns: times.Stamps | None = None


@dataclass(frozen=True, eq=False)
class Presses:
    """Buttons that have a stream of their own.

    Attributes:
        stamp_ns: Stamps (n,) [ns].
        log_ns: Times of recording (n,) [ns].
        pressed: Clutch, fixture, mode (n, 3).
    """

    stamp_ns: times.Stamps
    log_ns: times.Stamps
    pressed: NDArray[np.uint8]


class Source(Protocol):
    """A file being imported.

    Attributes:
        path: Where it is.
        told: What was taken, in words.
        time_unit: Unit of the times: ``auto`` if it is to be guessed.
        unit: Unit of the positions.
        is_unit_said: Whether the file or an option says it; else it is taken for metres.
        attitudes: How orientations are read; counts those that are none.
        has_time: Whether blocks have times.
    """

    path: Path
    told: list[str]
    time_unit: str
    unit: str
    is_unit_said: bool
    attitudes: orientation.Attitudes
    has_time: bool

    def blocks(self) -> Iterator[Block]:
        """All rows in the order of the file."""

    def presses(self) -> Presses | None:
        """Buttons beside the rows; None if there are none. Asked after the blocks."""

    def check(self, finite: Array) -> None:
        """Refuse columns that hold no number at all.

        Args:
            finite: How many numbers x, y, z and the orientation have (4,).

        Raises:
            RecordingError: Names them.
        """

    @property
    def bad_rows(self) -> int:
        """Rows that were left out because they are damaged."""
