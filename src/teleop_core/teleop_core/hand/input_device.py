"""Input device: readings of a gamepad or a 3-D mouse of this machine, as rates and buttons."""

from typing import NamedTuple, Protocol

import numpy as np

from teleop_core.kernels.geometry import Array


class DeviceReading(NamedTuple):
    """Present reading of a device.

    Attributes:
        rates: Deflection along x, y, z and about x, y, z of the master's base, each from -1 to 1, shape (6,); x points
            to the right, y up, z towards the person.
        is_held: Whether the person wants to move the stylus.
        fixture: Whether the fixture button is pressed.
        mode: Whether the mode button is pressed.
        jaw: Closing of the jaw, 0 open to 1 closed; None for a device without a jaw control.
    """

    rates: Array
    is_held: bool = False
    fixture: bool = False
    mode: bool = False
    jaw: float | None = None


UNHELD = "nobody holds the stylus"
"""End of a node's concern while no person moves the stylus; the console shows such a concern as no warning."""
NOTHING = DeviceReading(np.zeros(6))
"""Reading of an untouched device."""


class Device(Protocol):
    """An open device; all calls must come from one thread.

    Attributes:
        name: Name that the device reports.
    """

    name: str

    def read(self) -> DeviceReading:
        """Return the present reading, without waiting.

        Raises:
            SessionError: The device is disconnected.
        """

    def rumble(self, share: float) -> None:
        """Display a force by vibration; ``share`` is 0 to 1 of the largest force. Does nothing without a motor."""

    def close(self) -> None:
        """Close the device."""
