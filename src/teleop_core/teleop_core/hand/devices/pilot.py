"""Pilot: integrates rates of a device to poses that a remote hand follows."""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, fixed
from teleop_core.hand.devices import DeviceReading
from teleop_core.hand.operators.remote import RemoteHand
from teleop_core.kernels import Array, length, turn_by

_NEAR = 0.02  # a trigger within this share of its travel from its former position has returned to that position
_LONGEST = 0.05  # a longer time between two readings is integrated as this time [s]


@dataclass(frozen=True, kw_only=True)
class RateParameters:
    """Speeds of the stylus for devices whose deflection commands a velocity."""

    speed: float = fixed(
        0.04,
        Within(1e-3, 0.5, "m/s"),
        "speed of the stylus at full deflection of a stick or cap",
        source="assumed: crosses the Phantom's workspace in 4 s",
    )
    turn_speed: float = fixed(
        0.6,
        Within(0.01, 6.0, "rad/s"),
        "turning speed of the stylus at full deflection of a stick or cap",
        source="assumed: turns the stylus by a right angle in 2.6 s",
    )
    dead_zone: float = fixed(
        0.12,
        Within(0.0, 0.9),
        "deflections below this share of the full deflection count as zero",
        source="assumed: sticks of gamepads rest within a tenth of the middle",
    )


@dataclass(frozen=True, kw_only=True)
class PilotParameters(RateParameters):
    """Motion of the stylus by a device whose deflection commands a velocity."""

    device: str = fixed("", doc="part of the name of the device to use; empty: the first device found")


def beyond(rates: Array, dead_zone: float) -> Array:
    """Apply a dead zone to rates (N,) from -1 to 1: 0 within the zone, then linear up to 1."""
    size = np.clip((np.abs(rates) - dead_zone) / (1.0 - dead_zone), 0.0, 1.0)
    return np.asarray(np.sign(rates) * size)


def steer(pose: Array, rates: Array, time: float, parameters: RateParameters, low: Array, high: Array) -> None:
    """Move a pose (7,) at rates (6,) from -1 to 1 for a time [s]; clip its position to ``low``, ``high`` (3,) [m]."""
    moved = beyond(rates, parameters.dead_zone)
    pose[:3] = np.clip(pose[:3] + time * parameters.speed * moved[:3], low, high)
    turn_by(time * parameters.turn_speed * moved[3:], pose[3:])
    pose[3:] /= length(pose[3:])


class Pilot:
    """Integrates a person's readings of a device to poses of the stylus, and sends these poses to a hand.

    Args:
        hand: The hand that receives the poses.
        parameters: Speeds and dead zone.
    """

    def __init__(self, hand: RemoteHand, parameters: PilotParameters) -> None:
        self._hand, self._parameters = hand, parameters
        self._pose: Array | None = None
        self._has_buttons, self._leads_jaw = (False, False), True

    def step(self, reading: DeviceReading, dt: float) -> None:
        """Take a reading of the device, ``dt`` [s] after the last one."""
        self._press(reading)
        self._close(reading)
        if not reading.is_held:
            self.let_go()
            return
        time = min(dt, _LONGEST)
        if self._pose is None:
            self._pose, time = self._hand.pose, 0.0  # the first pose of a grip is the present pose of the stylus
        steer(self._pose, reading.rates, time, self._parameters, *self._hand.room)
        self._hand.want(self._pose)

    def let_go(self) -> None:
        """Let go of the stylus, if it is held."""
        if self._pose is not None:
            self._hand.let_go()
            self._pose = None

    def lose(self) -> None:
        """Let go of the stylus after the device was disconnected, and leave the jaw unchanged."""
        self.let_go()
        self._leads_jaw = False

    def _close(self, reading: DeviceReading) -> None:
        """Close the jaw by the share by which the device's trigger is pressed.

        A device that was reconnected reports an unpressed trigger. It moves the jaw again only after the trigger was
        pressed as far as the jaw is closed.
        """
        if reading.jaw is None:
            return
        self._leads_jaw = self._leads_jaw or reading.jaw >= self._hand.closing - _NEAR
        if self._leads_jaw:
            self._hand.close(reading.jaw)

    def _press(self, reading: DeviceReading) -> None:
        pressed = reading.fixture, reading.mode
        for name, now, before in zip(("fixture", "mode"), pressed, self._has_buttons, strict=True):
            if now is not before:
                self._hand.press(name, is_pressed=now)
        self._has_buttons = pressed
