"""Space mouse: a cap with six degrees of freedom that steers the stylus; its HID reports."""

import struct
import time
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from teleop_core.base.errors import SessionError
from teleop_core.hand.devices import DeviceReading, pilot
from teleop_core.hand.operators import Operator
from teleop_core.hand.operators.remote import AHEAD, make_remote
from teleop_core.kernels.geometry import Array

_MAKER = 0x256F  # 3Dconnexion
_OLD_MAKER = 0x046D  # Logitech
_OLD = range(0xC603, 0xC640)  # product numbers of the 3-D mice that Logitech sold
_USAGE = (0x01, 0x08)  # generic desktop, multi-axis controller
_MOVED, _TURNED, _PRESSED = 1, 2, 3  # kinds of reports
_FULL = 350.0
_LONGEST = 64  # largest number of bytes in a report
_REST = 0.5  # a cap at rest for longer counts as released; a cap without reports for longer counts as at rest [s]


@dataclass(frozen=True, kw_only=True)
class SpaceMouseParameters(pilot.PilotParameters):
    """How a 3-D mouse moves the stylus."""


class Reports:
    """State of a space mouse, collected from its reports.

    Numbers are 16-bit little-endian integers, about 350 at full deflection. Report 1 has x, y, z and report 2 the
    rotations about them, or report 1 has all six. Buttons are the bits of report 3. The x axis of the mouse points to
    the right, y towards the person, z down.

    Attributes:
        deflection: Translation and rotation of the cap in the mouse's axes, -1 to 1, shape (6,).
        buttons: Bits of the buttons; the lowest bit is the first button.
    """

    def __init__(self) -> None:
        self.deflection: Array = np.zeros(6)
        self.buttons = 0

    def take(self, report: bytes) -> bool:
        """Take a report; return whether it is complete and of a known kind."""
        kind, data = report[:1], report[1:]
        if kind == bytes([_PRESSED]) and data:
            self.buttons = int.from_bytes(data[:4], "little")
            return True
        if len(data) < 6 or kind not in (bytes([_MOVED]), bytes([_TURNED])):
            return False
        is_whole = len(data) >= 12
        numbers = struct.unpack_from("<6h" if is_whole else "<3h", data)
        first = 3 if kind[0] == _TURNED and not is_whole else 0
        self.deflection[first : first + len(numbers)] = np.clip(np.array(numbers) / _FULL, -1, 1)
        return True

    def rates(self) -> Array:
        """Rates (6,) in the master's base, whose y is up and z towards the person."""
        x, y, z, rx, ry, rz = self.deflection
        return np.array([x, -z, y, rx, -rz, ry])


class SpaceMouse:
    """An open 3-D mouse; see :class:`teleop_core.hand.devices.Device`.

    It moves the stylus while its cap is touched. The first button is the fixture button, the second one the mode
    button.

    Args:
        wanted: Part of the mouse's name; if empty, the first mouse is opened.
        dead_zone: Share of the deflection at which the cap counts as untouched.

    Raises:
        SessionError: hidapi is not installed; there is no such mouse; or there is no permission to read it.
    """

    def __init__(self, wanted: str = "", dead_zone: float = 0.1) -> None:
        found = space_mice()
        paths = [(name, path) for name, path in found if wanted.lower() in name.lower()]
        if not paths:
            called = f" with {wanted!r} in its name" if wanted else ""
            names = ", ".join(name for name, _ in found) or "none"
            raise SessionError(f"no 3-D mouse{called}; found: {names}")
        self.name, path = paths[0]
        self._own, self._reports, self._dead_zone = _hid().device(), Reports(), dead_zone
        try:
            self._own.open_path(path)
            self._own.set_nonblocking(1)
        except OSError as error:
            text = f"{self.name} cannot be opened: {error}; may this user read {path.decode()}?"
            raise SessionError(text) from error
        self._touched = self._heard = -np.inf

    def read(self) -> DeviceReading:
        """Return the present reading; raises SessionError if the mouse is disconnected."""
        now = time.monotonic()
        try:
            while report := self._own.read(_LONGEST):
                self._reports.take(bytes(report))
                self._heard = now
        except (OSError, ValueError) as error:
            raise SessionError(f"3-D mouse {self.name} is disconnected") from error
        if now - self._heard > _REST:
            self._reports.deflection[:] = 0.0
        rates = self._reports.rates()
        if np.abs(rates).max() > self._dead_zone:
            self._touched = now
        pressed = self._reports.buttons
        return DeviceReading(rates, now - self._touched < _REST, bool(pressed & 1), bool(pressed & 2))

    def rumble(self, share: float) -> None:
        """Do nothing: the mouse has no motor."""

    def close(self) -> None:
        """Close the mouse."""
        self._own.close()


def space_mice() -> list[tuple[str, bytes]]:
    """Name and path of each 3-D mouse; raises SessionError if hidapi is not installed."""
    return [
        (entry["product_string"] or "3-D mouse", entry["path"])
        for entry in _hid().enumerate()
        if is_space_mouse(entry["vendor_id"], entry["product_id"])
        and (entry["usage_page"], entry["usage"]) in {_USAGE, (0, 0)}  # 0 means unknown
    ]


def is_space_mouse(vendor: int, product: int) -> bool:
    """Whether vendor and product numbers of a USB device are those of a 3-D mouse."""
    return vendor == _MAKER or (vendor == _OLD_MAKER and product in _OLD)


def _hid() -> Any:
    try:
        return import_module("hid")
    except ImportError as error:
        text = "a 3-D mouse needs hidapi: pip install 'teleop_core[devices]'"
        raise SessionError(text) from error


def open_space_mouse(parameters: SpaceMouseParameters) -> SpaceMouse:
    """Open the mouse that the parameters name; raises the errors of :class:`SpaceMouse`."""
    return SpaceMouse(parameters.device, parameters.dead_zone)


SPACEMOUSE = Operator(
    "spacemouse", make_remote, SpaceMouseParameters, ahead=AHEAD, trembles=True, opens=open_space_mouse
)
