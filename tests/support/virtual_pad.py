"""A gamepad that SDL itself makes: the same path as one on a cable, without the cable."""

import ctypes
from pathlib import Path

from teleop_core.hand.devices.gamepad import Sdl

AXES = {"left x": 0, "left y": 1, "right x": 2, "right y": 3, "left trigger": 4, "right trigger": 5}
BUTTONS = {"a": 0, "b": 1, "left shoulder": 9, "right shoulder": 10, "up": 11, "down": 12}
_FULL = 32767


class VirtualPad:
    """A virtual gamepad, there until :meth:`unplug`."""

    def __init__(self) -> None:
        self._sdl = Sdl()
        maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
        path = next(line.split()[-1] for line in maps if "libSDL2-" in line)
        self._lib = lib = ctypes.CDLL(path)
        lib.SDL_JoystickOpen.restype = ctypes.c_void_p
        lib.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
        lib.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
        lib.SDL_JoystickClose.argtypes = [ctypes.c_void_p]
        self._number = lib.SDL_JoystickAttachVirtual(1, len(AXES), 15, 0)
        assert self._number >= 0
        self._own = lib.SDL_JoystickOpen(self._number)
        for trigger in ("left trigger", "right trigger"):
            self.move(trigger, -1.0)  # released

    def move(self, axis: str, share: float) -> None:
        """Deflect a stick, -1 to 1."""
        assert self._lib.SDL_JoystickSetVirtualAxis(self._own, AXES[axis], int(_FULL * share)) == 0

    def press(self, button: str, is_pressed: bool = True) -> None:
        """Press or release a button."""
        assert self._lib.SDL_JoystickSetVirtualButton(self._own, BUTTONS[button], is_pressed) == 0

    def unplug(self) -> None:
        """Take it away, if it is there."""
        if self._own is not None:
            self._lib.SDL_JoystickClose(self._own)
            self._lib.SDL_JoystickDetachVirtual(self._number)
            self._own = None
