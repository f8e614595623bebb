"""Sampled wall: our device and hand at a wall whose force is sampled and held."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from teleop_core.coupling.mapping.walls import wall_force
from teleop_core.graph import DT, topics
from teleop_core.hand.master.haptic_master import HapticMaster
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments import one_axis

AXIS = 1  # axis of the master's base along which the hand is pushed
_BLOCK = 500  # ticks for which noise is drawn at once
_KICK = 1e-4  # initial speed of the hand [m/s]
_SECONDS = 0.6  # duration of a simulation [s]
_SETTLE = 0.1  # time before the growth rate is measured [s]
_DELAYS = 40  # increase of _SECONDS, as a multiple of the force's delay
_SETTLED = 10  # increase of _SETTLE, as a multiple of the force's delay
_DEAD = 1e-12  # RMS speed [m/s] below which rounding errors dominate
_SHARES = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
"""Pushes that are tried, each minus one step of the wall's force, as parts of this step."""
_TAKEN, _RETURNED = (topics.MASTER_CONTACT.columns.index(name) for name in ("taken", "returned"))


@dataclass(frozen=True)
class Wall:
    """A wall on both sides of a plane, sampled once a period of 1 ms.

    Attributes:
        stiffness: Stiffness of the wall's spring [N/m].
        damping: Damping of the wall [N·s/m]; it acts on the difference of two samples.
        late: Delay of the wall's force, as a number of periods.
    """

    stiffness: float
    damping: float = 0.0
    late: int = 0


class SampledDevice:
    """Our device at a wall; between two samples the force is held.

    The spring is computed by ``walls.wall_force`` of the chain, as for ``wall=soft``, but without the limit of 5000 N/m
    of its parameter.

    Args:
        grip: The hand.
        wall: The wall; its plane contains the initial position of the device.
        own: Parameters of the device.
    """

    def __init__(self, grip: one_axis.Grip, wall: Wall, **own: float) -> None:
        self.master = HapticMaster(one_axis.ideal_device(grip, **own))
        self._wall, self._tick = wall, self.master.load()
        self._most = float(self.master.parameters.device.peak_force)
        self._depth, self._push, self._left = np.zeros(3), np.zeros(3), 0
        self._late = deque([0.0] * wall.late)
        self.origin = self._before = self.reading
        for name in ("position", "hand", "tip"):
            self.master.state[name][AXIS] = self.origin
        self.master.signals["hand_servo_cp_ns"] = 1

    @property
    def reading(self) -> float:
        """Position that the device measures [m]."""
        return float(self.master.signals["master_measured_cp"][AXIS])

    @property
    def place(self) -> float:
        """True position of the device [m]."""
        return float(self.master.state["position"][AXIS])

    @property
    def given(self) -> float:
        """Energy that the present contact returned minus the energy that it took [J], from ``master/contact``."""
        contact = self.master.signals["master_contact"]
        return float(contact[_RETURNED] - contact[_TAKEN])

    def move(self, speed: float) -> None:
        """Set the speed of hand and device [m/s]."""
        self.master.state["speed"][AXIS] = self.master.state["hand_speed"][AXIS] = speed

    def aim(self, place: float) -> None:
        """Set the wanted position of the hand [m], without an impact."""
        for name in ("wanted", "aim"):
            self.master.state[name][AXIS] = place
        self.master.signals["hand_servo_cp"][AXIS] = place

    def step(self) -> float:
        """Sample the wall and hold its force for a period; returns the force [N]."""
        wall, reading, felt = self._wall, self.reading, self.master.signals
        self._depth[AXIS] = reading - self.origin
        length = abs(reading - self.origin)
        wall_force(self._depth, length, wall.stiffness, self._most, self._push)
        damper = wall.damping * (reading - self._before) / DT
        self._before = reading
        self._late.append(float(self._push[AXIS]) - damper)
        force = self._late.popleft()
        felt["master_servo_cf"][AXIS] = force
        if self._left == 0:
            self.master.prepare(_BLOCK)
            self._left = _BLOCK
        self._left -= 1
        felt["hand_servo_cp_ns"] += 1
        self._tick()
        return force


def wall_growth(grip: one_axis.Grip, wall: Wall) -> float:
    """Growth rate [1/s] of the oscillation of our hand and device at a wall; negative for a decay."""
    loop = SampledDevice(grip, wall)
    loop.move(_KICK)
    place = np.empty(round(_SECONDS / DT) + _DELAYS * wall.late)
    for i in range(len(place)):
        loop.step()
        place[i] = loop.place
    speed: Array = np.diff(place)[round(_SETTLE / DT) + _SETTLED * wall.late :] / DT
    rest = speed[len(speed) // 2 :]
    # A motion below this speed has decayed; only its rounding errors may grow.
    return -1.0 / DT if np.sqrt(np.mean(rest * rest)) < _DEAD else one_axis.growth_rate(speed)


def wall_boundary(grip: one_axis.Grip, damping: float, late: int) -> float:
    """Stiffness [N/m] of a wall at which oscillations of our hand and device neither grow nor decay.

    Args:
        grip: The hand.
        damping: Damping of the wall [N·s/m].
        late: Delay of the wall's force, as a number of periods.
    """
    start = 0.3 * one_axis.sampled_boundary(grip, late, damping)
    return one_axis.boundary_from_below(lambda stiffness: wall_growth(grip, Wall(stiffness, damping, late)), start)


def press_energy(damping: float, wall: Wall, length: int, speed: float) -> float:
    """Energy [J] that a hand gets from a press into a wall, if it moves in and out at the same speed.

    No force changes the motion of this hand. The hand has pressed once before, so the press begins within the wall. The
    wall's work is that of ``master/contact``. The simulated device has no viscous friction; the energy that this
    friction would take is subtracted here.

    Args:
        damping: Viscous friction of the device [N·s/m].
        wall: The wall.
        length: Number of periods of the motion into the wall, equal to that of the motion out of the wall.
        speed: Speed of the hand [m/s].
    """
    loop = SampledDevice(one_axis.Grip(5.0, 1.0, 0.1), wall)
    loop.origin -= 0.25 * speed * DT  # no sample may lie on the plane, where the force 0 would end the contact
    before, lost = 0.0, 0.0
    for i in range(4 * length):
        if i == 2 * length:
            before, lost = loop.given, 0.0
        loop.move(speed if (i // length) % 2 == 0 else -speed)
        place = loop.place
        loop.step()
        lost += damping * (loop.place - place) ** 2 / DT
    return loop.given - before - lost


def passive_boundary(damping: float, wall_damping: float, length: int, speed: float) -> float:
    """Stiffness [N/m] above which the hand gains energy in a press; the wall's work is linear in the stiffness."""
    tried = 1000.0
    soft, stiff = (press_energy(damping, Wall(stiffness, wall_damping), length, speed) for stiffness in (0.0, tried))
    return tried * soft / (soft - stiff)


def is_restless(wall: Wall, friction: float, resolution: float, push: float) -> bool:
    """Whether a loose hand that presses on a wall keeps moving, because of dry friction and encoder steps.

    If the push lies between two steps of the wall's force, the hand comes to rest only if the friction reaches half a
    step: 2 f >= K Delta. The force is observed for 0.3 s, after 0.3 s.

    Args:
        wall: The wall.
        friction: Dry friction of the device [N].
        resolution: Encoder step of the device [m].
        push: Push of the hand [steps of the wall's force].
    """
    grip = one_axis.Grip(0.045, 1.0, 0.1)
    loop = SampledDevice(grip, wall, friction=friction, position_resolution=resolution)
    force = push * wall.stiffness * resolution
    loop.aim(loop.origin + force / grip.stiffness)
    forces = [loop.step() for _ in range(600)]
    return bool(np.ptp(forces[-300:]) > 0.0)


def restless_boundary(friction: float, resolution: float) -> float:
    """Stiffness [N/m] above which a loose hand keeps moving at some push, within 0.3 %."""

    def some(stiffness: float) -> bool:
        wall = Wall(stiffness)
        return any(is_restless(wall, friction, resolution, 1.0 + share) for share in _SHARES)

    low, high = 100.0, 50_000.0
    for _ in range(11):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if some(middle) else (middle, high)
    return (low * high) ** 0.5
