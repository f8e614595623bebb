"""One axis: a hand before a spring whose force comes late, exactly and through our own stages."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from teleop_core.base.parameters import build
from teleop_core.chain.mapping.motion_scaling import MotionScaling
from teleop_core.chain.mapping.parameters import MotionScalingParameters
from teleop_core.chain.master.haptic_master import HapticMaster, HapticMasterParameters
from teleop_core.graph.signals import DT, TICK_NS

_AXIS = 1  # of the master's base, along which the hand is pushed
_KICK = 1e-5  # speed that the hand is given [m/s]: far from every limit
_SETTLE, _LOOK = 1.0, 3.0  # before the growth is looked at, and for how long [s]
_BLOCK = 500  # ticks
_GRID = 4000


@dataclass(frozen=True)
class Grip:
    """How a hand holds the stylus.

    Attributes:
        mass: Hand and device together [kg].
        stiffness: Towards where the hand wants the stylus [N/m].
        damping: Of the same [N·s/m].
    """

    mass: float
    stiffness: float
    damping: float


def exact_boundary(grip: Grip, delay: float, period: float = DT) -> float:
    """Stiffness [N/m] up to which a hand stays calm before a spring whose force comes late.

    Args:
        grip: The hand.
        delay: Of the force [s].
        period: For which a force is held [s]; half of it is more delay.

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


def growth(grip: Grip, delay: float, stiffness: float) -> float:
    """Rate [1/s] at which our hand, device and mapping swing up before a spring; negative: down.

    The device is rigid, without friction and steps of its reading, and never warm.

    Args:
        grip: The hand.
        delay: Of the force, in whole ticks [s].
        stiffness: Of the spring [N/m], at the place where the slave's tip is commanded.
    """
    master = HapticMaster(_device(grip))
    mapping = MotionScaling(build(MotionScalingParameters, _MAPPING))
    felt, told = master.signals, mapping.signals
    feel, tell = master.load(), mapping.load()
    late = deque([np.zeros(3)] * (round(delay / DT) + 1))
    place = np.empty(round((_SETTLE + _LOOK) / DT))
    origin = np.zeros(3)
    felt["hand_servo_cp_ns"] = 1
    for i in range(len(place)):
        if i % _BLOCK == 0:
            master.prepare(_BLOCK)
        if i == _BLOCK:
            master.state["hand_speed"][_AXIS] += _KICK
        feel()
        felt["hand_servo_cp_ns"] += 1
        place[i] = master.state["position"][_AXIS]
        for name in ("master_measured_cp", "master_buttons"):
            told[name] = felt[name]
        told["slave_setpoint_cp"], told["slave_setpoint_cp_ns"] = (
            told["slave_servo_cp"],
            i * TICK_NS,
        )
        told["master_measured_cp_ns"] = told["slave_measured_cf_ns"] = (i + 1) * TICK_NS
        told["slave_measured_cf"][:3] = late.popleft()
        tell()
        command = told["slave_servo_cp"][:3].copy()
        if i < _BLOCK:
            origin = command
        late.append(-stiffness * (command - origin))
        felt["master_servo_cf"] = told["master_servo_cf"]
    speed = np.diff(place)[round(_SETTLE / DT) :]
    half = len(speed) // 2
    before, after = (float(part @ part) for part in (speed[:half], speed[half:]))
    return 0.5 * math.log(max(after, 1e-300) / max(before, 1e-300)) / (half * DT)


def found_boundary(grip: Grip, delay: float) -> float:
    """Stiffness [N/m] at which our hand, device and mapping neither swing up nor down.

    Searched from below, for what swings far is bounded by the largest force and grows no more.
    """
    exact = exact_boundary(grip, delay)
    high, rate = 0.3 * exact, -math.inf
    while rate < 0.0:
        low, before, high = high, rate, 1.15 * high
        rate = growth(grip, delay, high)
    if math.isinf(before):
        before = growth(grip, delay, low)
    for _ in range(3):
        middle = low + (high - low) * min(max(before / (before - rate), 0.1), 0.9)
        found = growth(grip, delay, middle)
        if found < 0.0:
            low, before = middle, found
        else:
            high, rate = middle, found
    return math.sqrt(low * high)


_MAPPING = {
    "reflection.architecture": "position_force", "reflection.max_force": 10.0,
    "feedback_timeout": 5.0, "reach_force.is_on": False,
}  # fmt: skip
_IDEAL_DEVICE = {
    "device.friction": 0.0, "device.position_resolution": 0.0, "device.gimbal_noise": 0.0,
    "device.stiffness": (1e7,) * 3, "device.peak_force": 50.0, "device.continuous_force": 50.0,
    "force_range": 1000.0,
}  # fmt: skip


def _device(grip: Grip) -> HapticMasterParameters:
    parameters = build(HapticMasterParameters, _IDEAL_DEVICE)
    own = {
        "hand.mass": grip.mass - parameters.device.apparent_mass,
        "hand.stiffness": grip.stiffness, "hand.damping": grip.damping,
    }  # fmt: skip
    return build(HapticMasterParameters, _IDEAL_DEVICE | own)
