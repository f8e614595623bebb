"""Source: a file from which an import reads poses and buttons of a hand, block by block."""

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
    """Rows of a file without conversion of units and axes.

    Attributes:
        time: Times (n,) in the file's unit; NaN if missing.
        position: Positions (n, 3) in the file's unit and axes.
        quaternion: Orientations (n, 4), w, x, y, z; NaN if missing.
        buttons: Whether clutch, fixture and mode are pressed (n, 3); None if the file has no columns of buttons.
        log_ns: Times of recording (n,) [ns] of a bag.
        closing: How far the jaw is closed (n,), 0 (open) to 1; NaN if missing. None if the file has no such column.
    """

    time: Array | times.Stamps
    position: Array
    quaternion: Array
    buttons: NDArray[np.uint8] | None = None
    log_ns: times.Stamps | None = None
    closing: Array | None = None


@dataclass(frozen=True, eq=False)
class Presses:
    """Buttons with their own stream.

    Attributes:
        stamp_ns: Stamps (n,) [ns].
        log_ns: Times of recording (n,) [ns].
        pressed: Whether clutch, fixture and mode are pressed (n, 3).
    """

    stamp_ns: times.Stamps
    log_ns: times.Stamps
    pressed: NDArray[np.uint8]


class Source(Protocol):
    """A file that is imported.

    Attributes:
        path: Path of the file.
        told: Texts about what was used.
        time_unit: Unit of the times: ``auto`` if it must be guessed.
        unit: Unit of the positions.
        is_unit_said: Whether the file or an option states the unit; if not, metres are assumed.
        attitudes: Converter of the orientations, which also counts invalid orientations.
        has_time: Whether the blocks contain times.
        labels: Names of time, position and orientation in the file, for messages.
    """

    path: Path
    told: list[str]
    time_unit: str
    unit: str
    is_unit_said: bool
    attitudes: orientation.Attitudes
    has_time: bool
    labels: tuple[str, str, str]

    def blocks(self) -> Iterator[Block]:
        """All rows in the order of the file."""

    def presses(self) -> Presses | None:
        """Buttons with their own stream; None if there are none. Must be called after the blocks were read."""

    def check(self, finite: Array) -> None:
        """Raise an error if a column contains no number.

        Args:
            finite: Number of finite values of x, y, z and the orientation (4,).

        Raises:
            RecordingError: A column contains no number; the message names all such columns.
        """

    @property
    def bad_rows(self) -> int:
        """Number of rows that were left out because they are damaged."""
