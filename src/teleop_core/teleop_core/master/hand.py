"""Hand: the operator as a mass on a spring and damper that wants to follow a path, with tremor."""

import math
from dataclasses import dataclass
from typing import Any

from teleop_core.geometry import Array
from teleop_core.kernels import inner
from teleop_core.parameters import parameter

# Coulomb friction of the device grows smoothly up to about this speed [m/s].
_FRICTION_SPEED = 5e-3
_STEPS = 4


@dataclass(frozen=True, kw_only=True)
class HandParameters:
    """The operator's hand: a mass on a spring and damper that wants to follow the path."""

    mass: float = parameter(0.15, unit="kg", lower=0.01, upper=5.0, doc="mass moved with the tip")
    stiffness: float = parameter(
        300.0, unit="N/m", lower=1.0, upper=5000.0, doc="how firmly the hand holds its path"
    )
    damping: float = parameter(12.0, unit="N·s/m", lower=0.1, upper=200.0, doc="damping of the arm")
    tremor_amplitude: float = parameter(
        0.1e-3, unit="m", lower=0.0, upper=5e-3, doc="amplitude of the wanted tremor on each axis"
    )
    tremor_frequency: float = parameter(
        10.0, unit="Hz", lower=8.0, upper=12.0, doc="middle of the tremor's band, which is ±2 Hz"
    )


@inner
def tremble(p: Any, s: Any, noise: Array, tremor: Array, dt: float) -> None:
    """Write the wanted tremor (3,) [m]: one line per axis whose frequency wanders in its band."""
    for i in range(3):
        # Ornstein-Uhlenbeck process of unit variance and half a second of memory.
        s.wander[i] += -s.wander[i] * (dt / 0.5) + noise[i] * math.sqrt(2.0 * dt / 0.5)
        width = min(2.0, p.frequency - 8.0, 12.0 - p.frequency)
        s.phase[i] += 2.0 * math.pi * dt * (p.frequency + width * math.tanh(s.wander[i]))
        tremor[i] = p.tremor * math.sin(s.phase[i])


@inner
def move_hand(p: Any, s: Any, wanted: Array, force: Array, dt: float) -> None:
    """Move tip and hand on by one tick under the device's force (3,) [N].

    Symplectic Euler in four equal steps, with damping and friction taken at the end of each
    step: stable for every hand and device that the parameters allow.
    """
    h = dt / _STEPS
    for i in range(3):
        aim_speed = (wanted[i] - s.wanted[i]) / dt
        for step in range(_STEPS):
            aim = s.wanted[i] + aim_speed * h * (step + 1)
            v = s.speed[i]
            drag = p.damping + p.friction / math.sqrt(v * v + _FRICTION_SPEED * _FRICTION_SPEED)
            pull = p.stiffness * (aim - s.position[i]) + p.damping * aim_speed + force[i]
            s.speed[i] = (v + h * pull / p.mass) / (1.0 + h * drag / p.mass)
            s.position[i] += h * s.speed[i]
        s.wanted[i] = wanted[i]
        low, high = p.center[i] - p.half[i], p.center[i] + p.half[i]
        if s.position[i] < low or s.position[i] > high:  # the device's stops
            s.position[i] = min(max(s.position[i], low), high)
            s.speed[i] = 0.0
