"""Hand: the operator as a mass on a spring and damper that wants to follow a path."""

import math
from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.kernels import inner
from teleop_core.kernels.fields import Fields, Vector3
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.room import room

_STEPS = 2


@dataclass(frozen=True, kw_only=True)
class HandParameters:
    """The operator's hand: a mass on a spring and damper that wants to follow the path."""

    mass: float = parameter(
        0.15, unit="kg", lower=0.01, upper=5.0, doc="mass moved with the tip",
        source="assumed: fingers and a part of the hand of some 0.4 kg; a fingertip alone "
        "has some grams (Hajian and Howe 1997)",
    )  # fmt: skip
    stiffness: float = parameter(
        300.0, unit="N/m", lower=1.0, upper=5000.0, doc="how firmly the hand holds its path",
        source="assumed: some 100 to 1000 N/m by grip, as of fingertips (Hajian and Howe 1997) and "
        "wrists that hold a stylus (Kuchenbecker, Park and Niemeyer 2003)",
    )  # fmt: skip
    damping: float = parameter(
        12.0, unit="N·s/m", lower=0.1, upper=200.0, doc="damping of the arm",
        source="assumed: 0.8 of critical with the masses and the stiffness here; fingertips have "
        "some 5 N·s/m (Hajian and Howe 1997), a firm grip more",
    )  # fmt: skip


class HandNumbers(Fields):
    """Fields of a parameter record with the mechanics of hand and device."""

    mass: float  # of the hand [kg]
    stiffness: float  # of its grip [N/m]
    damping: float  # of its grip [N·s/m]
    friction: float  # dry, of the device [N]
    device_mass: float  # [kg]
    device_damping: float  # [N·s/m]
    device_stiffness: Vector3  # [N/m]
    joined_share: Vector3
    lightness: Vector3  # [1/kg]
    hand_lightness: Vector3  # [1/kg]
    center: Vector3  # of the workspace [m]
    half: Vector3  # of its sides [m]


class HandState(Fields):
    """Fields of a state record with where both are."""

    position: Vector3  # of the device [m]
    speed: Vector3  # [m/s]
    hand: Vector3  # where the hand is [m]
    hand_speed: Vector3
    wanted: Vector3  # where it wants to be [m]


@inner
def move_hand(p: HandNumbers, s: HandState, wanted: Array, force: Array, dt: float) -> None:
    """Move hand and device on by one tick under the motors' force (3,) [N].

    Two masses on each axis: the hand, which a spring and a damper pull along its path, and the
    device with its motors, encoders and dry friction; between them the device's structure, a spring
    and a damper. Two equal Euler steps, implicit but for the hand's spring: stable for every hand
    and device that the parameters allow. Friction is a force of any direction up to its bound. It
    takes all speed that it can, so the device sticks, without creep, until what pulls is larger.

    Source:
        Kikuuwe, Takesue, Sano, Mochiyama and Fujimoto 2006 for Coulomb friction, a set of forces,
        by the implicit Euler step; Moreau 1988 for the scheme.
    """
    h, aim_speed = dt / _STEPS, room(3)
    for i in range(3):
        aim_speed[i] = (wanted[i] - s.wanted[i]) / dt
    for step in range(_STEPS):
        _push_on(p, s, aim_speed, force, h, h * (step + 1))
    for i in range(3):
        s.wanted[i] = wanted[i]
        low, high = p.center[i] - p.half[i], p.center[i] + p.half[i]
        if s.position[i] < low or s.position[i] > high:  # the device's stops
            s.position[i] = min(max(s.position[i], low), high)
            s.speed[i] = 0.0
            # They are in its joints; a hand that leans on one shall bend nothing.
            s.hand[i], s.hand_speed[i] = s.position[i], 0.0


@inner
def _push_on(
    p: HandNumbers, s: HandState, aim_speed: Array, force: Array, h: float, time: float
) -> None:
    """Make one step of ``h`` [s] that ends ``time`` [s] after the tick's begin."""
    free, pulled = room(3), room(3)
    square = 0.0
    for i in range(3):
        pull = p.stiffness * (s.wanted[i] + time * aim_speed[i] - s.hand[i])
        # Momenta of hand and device without friction and without what joins them.
        bent = h * p.device_stiffness[i] * (s.hand[i] - s.position[i])
        pulled[i] = p.mass * s.hand_speed[i] + h * (pull + p.damping * aim_speed[i]) - bent
        free[i] = p.device_mass * s.speed[i] + h * force[i] + bent + p.joined_share[i] * pulled[i]
        square += free[i] * free[i]
    rubbed = h * p.friction  # most momentum that friction takes
    left = 1.0 - rubbed / math.sqrt(square) if square > rubbed * rubbed else 0.0
    for i in range(3):
        s.speed[i] = left * free[i] * p.lightness[i]
        s.hand_speed[i] = pulled[i] * p.hand_lightness[i] + p.joined_share[i] * s.speed[i]
        s.position[i] += h * s.speed[i]
        s.hand[i] += h * s.hand_speed[i]


def join(p: HandNumbers, dt: float) -> None:
    """Write what the implicit step needs of the matrix that joins hand and device.

    Args:
        p: Parameter record with masses, dampings and stiffnesses; ``joined_share``, what the hand's
            momentum gives the device's, and ``lightness`` and ``hand_lightness`` [1/kg] of device
            and hand are written, (3,) each.
        dt: Tick [s].
    """
    h = dt / _STEPS
    joined = h * (p["device_damping"] + h * p["device_stiffness"])
    own = p["mass"] + h * p["damping"] + joined
    p["joined_share"], p["hand_lightness"] = joined / own, 1.0 / own
    p["lightness"] = 1.0 / (p["device_mass"] + joined - joined * joined / own)
