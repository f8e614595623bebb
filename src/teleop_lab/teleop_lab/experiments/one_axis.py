"""One axis: a hand that presses on a spring with a delayed force, computed exactly and with our own stages."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from teleop_core.base.parameters import build
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.mapping.motion_scaling import MotionScaling
from teleop_core.graph.signals import DT, TICK_NS
from teleop_core.hand.master.haptic_master import HapticMaster, HapticMasterParameters
from teleop_core.kernels.geometry import Array

_AXIS = 1  # axis of the master's base along which the hand is pushed
_KICK = 1e-5  # initial speed of the hand [m/s]; so small that no limit takes effect
_SETTLE = 1.0  # time before the growth rate is measured [s]
_LOOK = 3.0  # time in which the growth rate is measured [s]
_SETTLED = 10  # increase of _SETTLE, as a multiple of the force's delay
_LOOKS = 20  # increase of _LOOK, as a multiple of the force's delay
_BLOCK = 500  # ticks
_GRID = 4000
_LEAST_HAND = 0.01  # smallest mass of a hand that the parameters allow [kg]


@dataclass(frozen=True)
class Grip:
    """Mechanical model of a hand that holds the stylus.

    Attributes:
        mass: Mass of hand and device together [kg].
        stiffness: Stiffness towards the wanted position of the stylus [N/m].
        damping: Damping of the grip [N·s/m].
    """

    mass: float
    stiffness: float
    damping: float


def exact_boundary(grip: Grip, delay: float, period: float = DT) -> float:
    """Largest stiffness [N/m] of a spring with a delayed force at which a hand is stable.

    Args:
        grip: The hand.
        delay: Delay of the force [s].
        period: Time for which a force is held [s]; half of this time adds to the delay.

    Source:
        Roots of m s² + b s + k + K exp(-s t) on the imaginary axis: b w = K sin(w t) and
        m w² - k = K cos(w t); the least positive K.
    """
    late = delay + 0.5 * period

    def residue(w: float) -> float:
        inertia = grip.stiffness - grip.mass * w * w
        return inertia * math.sin(w * late) + grip.damping * w * math.cos(w * late)

    fastest = 4.0 * math.pi / late
    speeds = np.linspace(fastest / _GRID, fastest, _GRID)
    signs = np.sign([residue(w) for w in speeds])
    found = []
    for i in np.flatnonzero(signs[1:] != signs[:-1]):
        speed = float(brentq(residue, speeds[i], speeds[i + 1]))
        sine, cosine = math.sin(speed * late), math.cos(speed * late)
        if abs(sine) > abs(cosine):
            found.append(grip.damping * speed / sine)
        else:
            found.append((grip.mass * speed * speed - grip.stiffness) / cosine)
    return min(stiffness for stiffness in found if stiffness > 0.0)


def sampled_boundary(grip: Grip, ticks: int, damping: float = 0.0, period: float = DT) -> float:
    """Largest stiffness [N/m] of a sampled wall at which a hand is stable, computed exactly.

    Args:
        grip: The hand.
        ticks: Delay of the wall's force, as a number of periods.
        damping: Damping of the wall [N·s/m]; it acts on the difference of two samples.
        period: Time between two samples [s]; a force is held for this time.

    Source:
        Eigenvalues of the exact step of mass, spring and damper under a held force, with the delayed positions and
        forces as states; the smallest K at which an eigenvalue leaves the unit circle.
    """
    free = np.zeros((3, 3))
    free[0, 1], free[1] = 1.0, np.array([-grip.stiffness, -grip.damping, 1.0]) / grip.mass
    step = expm(free * period)

    def grows(stiffness: float) -> bool:
        # State: position, speed, previous position, then the forces, the newest force first.
        matrix = np.eye(3 + ticks, k=-1)
        matrix[:4] = 0.0
        matrix[:2, :2], matrix[2, 0] = step[:2, :2], 1.0
        force = np.zeros(3 + ticks)
        force[0], force[2] = -stiffness - damping / period, damping / period
        if ticks:
            matrix[3], matrix[:2, -1] = force, matrix[:2, -1] + step[:2, 2]
        else:
            matrix[:2] += np.outer(step[:2, 2], force)
        return bool(np.abs(np.linalg.eigvals(matrix)).max() > 1.0)

    low, high = 0.0, 1.0
    while not grows(high):
        low, high = high, 1.1 * high
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return low


class Mapped:
    """Simulation of our hand, an ideal device and the mapping, tick by tick; the caller simulates the arm.

    Args:
        grip: The hand.
        own: Parameters of the motion scaling.

    Attributes:
        master: Simulation of the device and the hand.
    """

    def __init__(self, grip: Grip, own: Mapping[str, float | str] | None = None) -> None:
        self.master = HapticMaster(ideal_device(grip))
        self._mapping = MotionScaling(build(MotionScalingParameters, _MAPPING | dict(own or {})))
        self._feel, self._tell, self._ticks = self.master.load(), self._mapping.load(), 0
        self.master.signals["hand_servo_cp_ns"] = 1

    @property
    def push(self) -> Array:
        """Force (3,) on the hand in the next tick [N], in the master's base."""
        return self.master.signals["master_servo_cf"][:3]

    def step(self, force: Array) -> Array:
        """Make one tick; returns the command (3,) [m].

        Args:
            force: Force on the tip (3,) [N] that arrives in this tick, in the slave's base.
        """
        felt, told = self.master.signals, self._mapping.signals
        if self._ticks % _BLOCK == 0:
            self.master.prepare(_BLOCK)
        self._feel()
        felt["hand_servo_cp_ns"] += 1
        for name in ("master_measured_cp", "master_buttons"):
            told[name] = felt[name]
        told["slave_setpoint_cp"] = told["slave_servo_cp"]
        told["slave_setpoint_cp_ns"] = self._ticks * TICK_NS
        self._ticks += 1
        told["master_measured_cp_ns"] = told["slave_measured_cf_ns"] = self._ticks * TICK_NS
        told["slave_measured_cf"][:3] = force
        self._tell()
        felt["master_servo_cf"] = told["master_servo_cf"]
        command: Array = told["slave_servo_cp"][:3].copy()
        return command


def growth(grip: Grip, delay: float, stiffness: float) -> float:
    """Growth rate [1/s] of the oscillation of our hand, device and mapping at a spring; negative for a decay.

    The device is rigid. It has no friction, no encoder steps and no thermal limit.

    Args:
        grip: The hand.
        delay: Delay of the force, in whole ticks, in addition to the tick of the graph [s].
        stiffness: Stiffness of the spring [N/m] at the commanded position of the slave's tip.
    """
    chain = Mapped(grip)
    late = deque([np.zeros(3)] * (round(delay / DT) + 1))
    settle = round((_SETTLE + _SETTLED * delay) / DT)
    place = np.empty(settle + round((_LOOK + _LOOKS * delay) / DT))
    origin = np.zeros(3)
    for i in range(len(place)):
        if i == _BLOCK:
            chain.master.state["hand_speed"][_AXIS] += _KICK
        command = chain.step(late.popleft())
        place[i] = chain.master.state["position"][_AXIS]
        if i < _BLOCK:
            origin = command
        late.append(-stiffness * (command - origin))
    return growth_rate(np.diff(place)[settle:])


def growth_rate(speed: Array, period: float = DT) -> float:
    """Growth rate [1/s] from the first half of speeds (N,) to the second half; negative for a decay.

    Args:
        speed: Speeds (N,).
        period: Time between two speeds [s].
    """
    half = len(speed) // 2
    before, after = (float(part @ part) for part in (speed[:half], speed[half:]))
    return 0.5 * math.log(max(after, 1e-300) / max(before, 1e-300)) / (half * period)


def found_boundary(grip: Grip, delay: float) -> float:
    """Stiffness [N/m] at which oscillations of our hand, device and mapping neither grow nor decay."""
    start = 0.3 * exact_boundary(grip, delay + DT)
    return boundary_from_below(lambda stiffness: growth(grip, delay, stiffness), start)


def boundary_from_below(rate_at: Callable[[float], float], start: float) -> float:
    """Stiffness [N/m] at which a growth rate becomes 0.

    The search begins at low stiffness. At high stiffness the largest force limits the oscillations, so they would not
    grow.

    Args:
        rate_at: Function that returns the growth rate [1/s] for a stiffness [N/m].
        start: A stable stiffness [N/m].
    """
    high, rate = start, -math.inf
    while rate < 0.0:
        low, before, high = high, rate, 1.15 * high
        rate = rate_at(high)
    if math.isinf(before):
        before = rate_at(low)
    for _ in range(4):
        middle = low + (high - low) * min(max(before / (before - rate), 0.1), 0.9)
        found = rate_at(middle)
        if found < 0.0:
            low, before = middle, found
        else:
            high, rate = middle, found
    return math.sqrt(low * high)


_MAPPING = {
    "reflection.architecture": "position_force",
    "reflection.max_force": 10.0,
    "feedback_timeout": 5.0,
    "reach_force.is_on": False,
}
_IDEAL_DEVICE = {
    "device.friction": 0.0,
    "device.position_resolution": 0.0,
    "device.gimbal_noise": 0.0,
    "device.stiffness": (1e7,) * 3,
    "device.structure_damping": 1e3,
    "device.peak_force": 50.0,
    "device.continuous_force": 50.0,
    "force_range": 1000.0,
}


def ideal_device(grip: Grip, **own: float) -> HapticMasterParameters:
    """Our hand with a grip, and our device: rigid, without friction, encoder steps and thermal limit.

    Args:
        grip: The hand. If its mass is hardly larger than that of our device, a lighter device is used.
        own: Parameters of the device that replace the ideal ones, such as ``friction``.
    """
    parameters = build(HapticMasterParameters, _IDEAL_DEVICE)
    device = min(parameters.device.apparent_mass, grip.mass - _LEAST_HAND)
    return build(
        HapticMasterParameters,
        _IDEAL_DEVICE
        | {
            "device.apparent_mass": device,
            "hand.mass": grip.mass - device,
            "hand.stiffness": grip.stiffness,
            "hand.damping": grip.damping,
            **{f"device.{name}": value for name, value in own.items()},
        },
    )
