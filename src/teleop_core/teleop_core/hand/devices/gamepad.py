"""Gamepad: two sticks that steer the stylus while a shoulder button is held, through SDL."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from teleop_core.base import SessionError, Within, fixed
from teleop_core.hand.devices import DeviceReading, pilot
from teleop_core.hand.operators import Operator
from teleop_core.hand.operators.remote import AHEAD, make_remote

_FULL = 32767.0
_RUMBLE_TIME = 0.2  # a rumble that is not renewed ends [s]
_HINTS = {
    "SDL_VIDEODRIVER": "dummy",  # events need a video driver; this one opens no window
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
    "SDL_NO_SIGNAL_HANDLERS": "1",  # the node handles signals
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
}


@dataclass(frozen=True, kw_only=True)
class GamepadParameters(pilot.PilotParameters):
    """How a gamepad moves the stylus, and how the gamepad displays the force."""

    rumble: float = fixed(1.0, Within(0.0, 1.0), "strength of the rumble at the device's peak force; 0: no rumble")
    triggers: str = fixed(
        "roll",
        choices=("roll", "jaw"),
        doc="roll: the triggers roll the stylus; jaw: the right trigger closes the jaw, and no "
        "trigger rolls the stylus",
    )


class Sdl:
    """Joysticks found by SDL, and those whose layout SDL knows.

    Raises:
        SessionError: pygame-ce is not installed.
    """

    def __init__(self) -> None:
        for name, value in _HINTS.items():
            os.environ.setdefault(name, value)
        try:
            self.pygame: Any = import_module("pygame")
            self.controllers: Any = import_module("pygame._sdl2.controller")
        except ImportError as error:
            text = "a gamepad needs pygame-ce: pip install 'teleop_core[devices]'"
            raise SessionError(text) from error
        self.pygame.display.init()
        self.pygame.joystick.init()
        self.controllers.init()
        self.pygame.event.pump()

    def names(self) -> Iterator[tuple[int, str, bool]]:
        """Number and name of each joystick, and whether SDL knows its layout."""
        for number in range(self.pygame.joystick.get_count()):
            is_known = bool(self.controllers.is_controller(number))
            yield number, str(self.pygame.joystick.Joystick(number).get_name()), is_known


class Gamepad:
    """An open gamepad; see :class:`teleop_core.hand.devices.Device`.

    The left stick moves the stylus sideways, forwards and backwards. The right stick moves it up and down, and turns
    it about the vertical. The triggers roll the stylus, or the right trigger closes the jaw; the direction pad tilts
    it. The stylus moves only while a shoulder button is held. Button A is the fixture button, button B the mode
    button.

    Args:
        wanted: Part of the gamepad's name; if empty, the first gamepad is opened.
        leads_jaw: Whether the right trigger closes the jaw.

    Raises:
        SessionError: There is no such gamepad; the message lists what was found.
    """

    def __init__(self, wanted: str = "", *, leads_jaw: bool = False) -> None:
        self._sdl, self._leads_jaw = Sdl(), leads_jaw
        found = list(self._sdl.names())
        for number, name, is_known in found:
            if is_known and wanted.lower() in name.lower():
                self.name, self._own = name, self._sdl.controllers.Controller(number)
                return
        texts = [name if known else f"{name} (of unknown layout)" for _, name, known in found]
        called = f" with {wanted!r} in its name" if wanted else ""
        raise SessionError(f"no gamepad{called}; found: {', '.join(texts) or 'none'}")

    def read(self) -> DeviceReading:
        """Return the present reading; raises SessionError if the gamepad is disconnected."""
        self._sdl.pygame.event.pump()
        self._sdl.pygame.event.clear()
        if not self._own.attached():
            raise SessionError(f"gamepad {self.name} is disconnected")
        pad, axis, button = self._sdl.pygame, self._axis, self._button
        right, left = map(axis, (pad.CONTROLLER_AXIS_TRIGGERRIGHT, pad.CONTROLLER_AXIS_TRIGGERLEFT))
        rates = np.array(
            [
                axis(pad.CONTROLLER_AXIS_LEFTX),
                -axis(pad.CONTROLLER_AXIS_RIGHTY),  # SDL reports a stick that is pushed away as negative
                axis(pad.CONTROLLER_AXIS_LEFTY),
                button(pad.CONTROLLER_BUTTON_DPAD_DOWN) - button(pad.CONTROLLER_BUTTON_DPAD_UP),
                -axis(pad.CONTROLLER_AXIS_RIGHTX),
                0.0 if self._leads_jaw else left - right,
            ]
        )
        shoulders = pad.CONTROLLER_BUTTON_LEFTSHOULDER, pad.CONTROLLER_BUTTON_RIGHTSHOULDER
        return DeviceReading(
            rates,
            any(map(button, shoulders)),
            button(pad.CONTROLLER_BUTTON_A),
            button(pad.CONTROLLER_BUTTON_B),
            right if self._leads_jaw else None,
        )

    def _axis(self, number: int) -> float:
        return max(float(self._own.get_axis(number)) / _FULL, -1.0)

    def _button(self, number: int) -> bool:
        return bool(self._own.get_button(number))

    def rumble(self, share: float) -> None:
        """Rumble with a share, 0 to 1; does nothing if the gamepad cannot rumble."""
        if share > 0.0:
            self._own.rumble(share, share, round(1000 * _RUMBLE_TIME))
        else:
            self._own.stop_rumble()

    def close(self) -> None:
        """Close the gamepad."""
        self._own.quit()


def open_gamepad(parameters: GamepadParameters) -> Gamepad:
    """Open the gamepad that the parameters name; raises the errors of :class:`Gamepad`."""
    return Gamepad(parameters.device, leads_jaw=parameters.triggers == "jaw")


GAMEPAD = Operator("gamepad", make_remote, GamepadParameters, ahead=AHEAD, trembles=True, opens=open_gamepad)
