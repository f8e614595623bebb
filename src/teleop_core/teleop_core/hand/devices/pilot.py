"""Pilot: rates of a device, summed up to poses that a remote hand follows."""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.hand.devices import Reading
from teleop_core.hand.operators.remote import RemoteHand
from teleop_core.kernels import Array, length, turn_by

_NEAR = 0.02  # share of the jaw's way: a trigger that is as far pressed as before
_LONGEST = 0.05  # a reader that slept longer has lost time, not made way [s]


@dataclass(frozen=True, kw_only=True)
class RateParameters:
    """How fast a device that says rates moves the stylus."""

    speed: float = parameter(
        0.04,
        Within(1e-3, 0.5, "m/s"),
        "speed at full deflection",
        fixed=True,
        source="assumed: through the Phantom's workspace in four seconds",
    )
    turn_speed: float = parameter(
        0.6,
        Within(0.01, 6.0, "rad/s"),
        "speed of the turn at full deflection",
        fixed=True,
        source="assumed: a right angle in 2.6 s",
    )
    dead_zone: float = parameter(
        0.12,
        Within(0.0, 0.9),
        "share of the deflection that counts as none",
        fixed=True,
        source="assumed: sticks of gamepads rest within a tenth of the middle",
    )


@dataclass(frozen=True, kw_only=True)
class PilotParameters(RateParameters):
    """How a device that says rates moves the stylus."""

    device: str = parameter("", fixed=True, doc="part of the device's name; empty: the first that is found")


def beyond(rates: Array, dead_zone: float) -> Array:
    """Rates (N,) from -1 to 1 without the dead zone: 0 within it, then rising to 1 steadily."""
    size = np.clip((np.abs(rates) - dead_zone) / (1.0 - dead_zone), 0.0, 1.0)
    return np.asarray(np.sign(rates) * size)


def steer(pose: Array, rates: Array, time: float, parameters: RateParameters, low: Array, high: Array) -> None:
    """Move a pose (7,) at rates (6,) from -1 to 1 for a time [s]; its place stays from ``low`` to ``high`` (3,) [m]."""
    moved = beyond(rates, parameters.dead_zone)
    pose[:3] = np.clip(pose[:3] + time * parameters.speed * moved[:3], low, high)
    turn_by(time * parameters.turn_speed * moved[3:], pose[3:])
    pose[3:] /= length(pose[3:])


class Pilot:
    """Tells a hand where a person steers the stylus.

    Args:
        hand: Who is told.
        parameters: Speeds and dead zone.
    """

    def __init__(self, hand: RemoteHand, parameters: PilotParameters) -> None:
        self._hand, self._parameters = hand, parameters
        self._pose: Array | None = None
        self._has_buttons, self._leads_jaw = (False, False), True

    def step(self, reading: Reading, dt: float) -> None:
        """Take what the device says, ``dt`` [s] after the last time."""
        self._press(reading)
        self._close(reading)
        if not reading.is_held:
            self.let_go()
            return
        time = min(dt, _LONGEST)
        if self._pose is None:
            self._pose, time = self._hand.pose, 0.0  # the first pose of a grip is where it is
        steer(self._pose, reading.rates, time, self._parameters, *self._hand.room)
        self._hand.want(self._pose)

    def let_go(self) -> None:
        """Let go of the stylus, if it is held."""
        if self._pose is not None:
            self._hand.let_go()
            self._pose = None

    def lose(self) -> None:
        """Let go of the stylus, and leave the jaw as it is: the device is gone."""
        self.let_go()
        self._leads_jaw = False

    def _close(self, reading: Reading) -> None:
        """Close the jaw as far as the device says.

        One that came back says that nothing is pressed. It leads the jaw again once it was closed as far as it is.
        """
        if reading.jaw is None:
            return
        self._leads_jaw = self._leads_jaw or reading.jaw >= self._hand.closing - _NEAR
        if self._leads_jaw:
            self._hand.close(reading.jaw)

    def _press(self, reading: Reading) -> None:
        pressed = reading.fixture, reading.mode
        for name, now, before in zip(("fixture", "mode"), pressed, self._has_buttons, strict=True):
            if now is not before:
                self._hand.press(name, is_pressed=now)
        self._has_buttons = pressed
