"""Devices: what a person holds at this machine, a gamepad or a 3-D mouse, as rates and buttons.

None of them is needed to import this package; their libraries are the extra ``devices``.
"""

from typing import NamedTuple, Protocol

import numpy as np

from teleop_core.kernels.geometry import Array

__all__ = ["NOTHING", "Device", "Reading"]


class Reading(NamedTuple):
    """What a device says now.

    Attributes:
        rates: How far it is deflected along x, y, z and about x, y, z of the master's base: x to
            the right, y up, z towards the person; each from -1 to 1, shape (6,).
        is_held: Whether the person wants to move the stylus.
        fixture: Whether the fixture button is pressed.
        mode: Whether the mode button is pressed.
        jaw: How far the jaw is closed, 0 open to 1 closed; None of a device that leads none.
    """

    rates: Array
    is_held: bool = False
    fixture: bool = False
    mode: bool = False
    jaw: float | None = None


NOTHING = Reading(np.zeros(6))
"""Reading of a device that nobody touches."""


class Device(Protocol):
    """A device that is open; all calls come from one thread.

    Attributes:
        name: What it calls itself.
    """

    name: str

    def read(self) -> Reading:
        """What it says now; does not wait.

        Raises:
            SessionError: It is gone.
        """

    def rumble(self, share: float) -> None:
        """Let the person feel a force, 0 to 1 of the largest; nothing where it cannot."""

    def close(self) -> None:
        """Give it back."""
