"""Haptic master, simulated: a Phantom Omni in the hand of an operator."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from teleop_core.compiled import kernel
from teleop_core.errors import ParameterError
from teleop_core.geometry import (
    Array,
    multiply_quaternions,
    quaternion_from_rotation,
    rotate_by_vector,
    rotation,
)
from teleop_core.master.paths import Path, PathParameters
from teleop_core.parameters import parameter
from teleop_core.signals import DT, make_signals

# The stylus rests in the inkwell at this tilt about x (Vongbunyong 2008, table 6.1; its sign is
# the one that meets the slave's home), at this place in the master's base.
REST_TILT = math.radians(-23.4)
REST_POSITION = (0.0, -0.065511, -0.088114)
BLOCK = 1000
"""Ticks for which the wanted path and the noise are drawn at once."""


@dataclass(frozen=True, kw_only=True)
class DeviceParameters:
    """The Phantom Omni as its maker publishes it (Vongbunyong 2008, table 5.1)."""

    workspace: tuple[float, ...] = parameter(
        (0.16, 0.12, 0.07), unit="m", lower=0.01, upper=1.0, length=3,
        doc="width, height, depth within which the tip can move",
    )  # fmt: skip
    start: tuple[float, ...] = parameter(
        (0.0, 0.0, -0.03), unit="m", lower=-0.5, upper=0.5, length=3, fixed=True,
        doc="place of the inkwell relative to the middle of the workspace",
    )  # fmt: skip
    position_resolution: float = parameter(
        0.055e-3, unit="m", lower=0.0, upper=1e-2, doc="step of the position reading; 0: none"
    )
    gimbal_noise: float = parameter(
        2e-3, unit="rad", lower=0.0, upper=0.1, doc="largest noise of each gimbal potentiometer"
    )
    peak_force: float = parameter(3.3, unit="N", lower=0.0, upper=50.0, doc="largest force")
    apparent_mass: float = parameter(0.045, unit="kg", lower=1e-3, upper=5.0, doc="mass at the tip")
    friction: float = parameter(0.26, unit="N", lower=0.0, upper=5.0, doc="backdrive friction")


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


@dataclass(frozen=True, kw_only=True)
class ButtonParameters:
    """When the operator uses the buttons [s]; each press of fixture or mode lasts 0.1 s."""

    clutch: tuple[float, ...] = parameter(
        (), unit="s", lower=0.0, fixed=True, doc="press, release, press, release, …"
    )
    fixture: tuple[float, ...] = parameter(
        (), unit="s", lower=0.0, fixed=True, doc="presses: each toggles the box"
    )
    mode: tuple[float, ...] = parameter(
        (), unit="s", lower=0.0, fixed=True, doc="presses: each toggles coarse and fine"
    )

    def __post_init__(self) -> None:
        if len(self.clutch) % 2 or list(self.clutch) != sorted(self.clutch):
            raise ParameterError("buttons.clutch", self.clutch, "rising pairs of press, release")


@dataclass(frozen=True, kw_only=True)
class HapticMasterParameters:
    """Parameters of :class:`HapticMaster`."""

    seed: int = parameter(1, lower=0, fixed=True, doc="seed of everything random in the session")
    force_timeout: float = parameter(
        0.1, unit="s", lower=0.002, upper=5.0, doc="without a newer servo_cf the force is zero"
    )
    device: DeviceParameters = field(default_factory=DeviceParameters)
    hand: HandParameters = field(default_factory=HandParameters)
    path: PathParameters = field(default_factory=PathParameters)
    buttons: ButtonParameters = field(default_factory=ButtonParameters)


_PARAMETERS = np.dtype(
    [(name, "f8") for name in ("resolution", "gimbal", "peak_force", "mass", "friction",
     "stiffness", "damping", "tremor", "frequency")]
    + [("center", "f8", (3,)), ("half", "f8", (3,))]
)  # fmt: skip
_STATE = np.dtype(
    [(name, "f8", (3,)) for name in ("position", "speed", "wanted", "phase", "wander", "reading",
     "rate", "turning")] + [("attitude", "f8", (4,))]
)  # fmt: skip
# Coulomb friction of the device grows smoothly up to about this speed [m/s].
_FRICTION_SPEED = 5e-3
_STEPS = 4


@kernel
def _tremble(p: Any, s: Any, noise: Array, tremor: Array) -> None:
    """Write the wanted tremor (3,) [m]: one line per axis whose frequency wanders in its band."""
    for i in range(3):
        # Ornstein-Uhlenbeck process of unit variance and half a second of memory.
        s.wander[i] += -s.wander[i] * (1e-3 / 0.5) + noise[i] * math.sqrt(2.0 * 1e-3 / 0.5)
        s.phase[i] += 2.0 * math.pi * 1e-3 * (p.frequency + 2.0 * math.tanh(s.wander[i]))
        tremor[i] = p.tremor * math.sin(s.phase[i])


@kernel
def _move_hand(p: Any, s: Any, wanted: Array, force: Array) -> None:
    """Move tip and hand on by one tick under the device's force (3,) [N].

    Symplectic Euler in four steps of 0.25 ms; the fastest mode of hand and device is 70 rad/s.
    """
    h = 1e-3 / _STEPS
    for i in range(3):
        aim_speed = (wanted[i] - s.wanted[i]) / 1e-3
        for step in range(_STEPS):
            aim = s.wanted[i] + aim_speed * h * (step + 1)
            v = s.speed[i]
            drag = p.friction * v / math.sqrt(v * v + _FRICTION_SPEED * _FRICTION_SPEED)
            pull = p.stiffness * (aim - s.position[i]) + p.damping * (aim_speed - v)
            s.speed[i] += h * (pull + force[i] - drag) / p.mass
            s.position[i] += h * s.speed[i]
        s.wanted[i] = wanted[i]
        low, high = p.center[i] - p.half[i], p.center[i] + p.half[i]
        if s.position[i] < low or s.position[i] > high:  # the device's stops
            s.position[i] = min(max(s.position[i], low), high)
            s.speed[i] = 0.0


@kernel
def _read_device(p: Any, s: Any, attitude: Array, noise: Array, row: Any) -> None:
    """Write measured_cp and measured_cv: quantised place, noisy attitude, filtered rates (5 ms)."""
    pose, twist = row.master_measured_cp, row.master_measured_cv
    share = 1e-3 / (1e-3 + 5e-3)
    for i in range(3):
        reading = s.position[i]
        if p.resolution > 0.0:
            reading = round(reading / p.resolution) * p.resolution
        s.rate[i] += ((reading - s.reading[i]) / 1e-3 - s.rate[i]) * share
        s.reading[i] = reading
        pose[i], twist[i] = reading, s.rate[i]
    wobble = np.empty(3)
    for i in range(3):
        # The noise counts as two standard deviations and never exceeds its bound.
        wobble[i] = p.gimbal * min(max(0.5 * noise[3 + i], -1.0), 1.0)
    rotate_by_vector(attitude, wobble[0], wobble[1], wobble[2], pose[3:7])
    back = np.empty(4)
    back[0] = s.attitude[0]
    for i in range(1, 4):
        back[i] = -s.attitude[i]
    multiply_quaternions(pose[3:7], back, back)
    sign = 1.0 if back[0] >= 0.0 else -1.0
    for i in range(3):
        # Small turn between two samples: twice the vector part, in base axes.
        s.turning[i] += (sign * 2.0 * back[1 + i] / 1e-3 - s.turning[i]) * share
        twist[3 + i] = s.turning[i]
    for i in range(4):
        s.attitude[i] = pose[3 + i]


@kernel
def haptic_master_step(
    p: Any, s: Any, wanted: Array, attitude: Array, noise: Array, buttons: Array, row: Any
) -> None:
    """One tick: feel master_servo_cf, move, and write master_measured_cp, _cv, _cf and _buttons.

    Args:
        p: Parameter record.
        s: State record; written.
        wanted: Where the hand wants to be (3,) [m], master's base.
        attitude: How it holds the stylus, quaternion (4,).
        noise: Standard normal numbers (6,): tremor x, y, z, gimbal x, y, z.
        buttons: clutch, fixture, mode (3,).
        row: Signals.
    """
    force = np.empty(3)
    command = row.master_servo_cf
    size = math.sqrt(command[0] ** 2 + command[1] ** 2 + command[2] ** 2)
    share = 1.0 if size <= p.peak_force else p.peak_force / size
    tremor = np.empty(3)
    _tremble(p, s, noise, tremor)
    for i in range(3):
        force[i] = share * command[i]
        tremor[i] += wanted[i]
    _move_hand(p, s, tremor, force)
    _read_device(p, s, attitude, noise, row)
    for i in range(3):
        row.master_measured_cf[i] = force[i]
        row.master_measured_cf[3 + i] = 0.0
        row.master_buttons[i] = buttons[i]


class HapticMaster:
    """Stage that simulates device and operator, 1 kHz.

    ``signals`` is the record it reads (``master_servo_cf``) and writes (``master_measured_cp``,
    ``_cv``, ``_cf``, ``master_buttons``). The same parameters give the same motion, bit for bit,
    as long as the same forces act on it.

    Args:
        parameters: What device, hand and path are.
        signals: Record shared with other stages; None for one of its own.
        recorded: Path of a recording, for the path kind "bag"; see :class:`Path`.
    """

    def __init__(
        self,
        parameters: HapticMasterParameters,
        signals: Any = None,
        recorded: tuple[Array, Array] | None = None,
    ) -> None:
        self.signals = make_signals(1)[0] if signals is None else signals
        self.parameters = np.zeros(1, _PARAMETERS)[0]
        self.state = np.zeros(1, _STATE)[0]
        self._fixed, self._recorded = parameters, recorded
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Stylus in the inkwell, at time zero, with the random numbers of the seed."""
        self._rng = np.random.default_rng(self._fixed.seed)
        self._path = Path(self._fixed.path, self._rng, self._recorded)
        self._tick, self._used = 0, BLOCK
        self._block: tuple[Array, ...] | None = None
        self._rest = np.empty(4)
        quaternion_from_rotation(rotation("x", REST_TILT), self._rest)
        for name in _STATE.names or ():
            self.state[name] = 0.0
        for name in ("position", "wanted", "reading"):
            self.state[name] = REST_POSITION
        self.state["attitude"] = self._rest
        pose = self.signals["master_measured_cp"]
        pose[:3], pose[3:] = REST_POSITION, self._rest

    def retune(self, parameters: HapticMasterParameters) -> None:
        """Take new device and hand parameters from the next tick on; the path stays."""
        p, device, hand = self.parameters, parameters.device, parameters.hand
        p["resolution"], p["gimbal"] = device.position_resolution, device.gimbal_noise
        p["peak_force"], p["friction"] = device.peak_force, device.friction
        p["mass"] = device.apparent_mass + hand.mass
        p["stiffness"], p["damping"] = hand.stiffness, hand.damping
        p["tremor"], p["frequency"] = hand.tremor_amplitude, hand.tremor_frequency
        p["center"] = np.subtract(REST_POSITION, device.start)
        p["half"] = 0.5 * np.array(device.workspace)

    def draw(self, count: int) -> tuple[Array, Array, Array, Array]:
        """What the operator wants in the next ``count`` ticks.

        Returns:
            Wanted positions (count, 3) [m], attitudes (count, 4), noise (count, 6), buttons
            (count, 3), as :func:`haptic_master_step` takes them row by row.
        """
        times = np.arange(self._tick + 1, self._tick + count + 1, dtype=np.float64) * DT
        self._tick += count
        position, turn = self._path.sample(times)
        attitudes = np.empty((count, 4))
        _turn_all(self._rest, turn, attitudes)
        noise = self._rng.standard_normal((count, 6))
        return position + REST_POSITION, attitudes, noise, self._pressed(times)

    def _pressed(self, times: Array) -> Array:
        buttons = self._fixed.buttons
        pressed = np.zeros((len(times), 3))
        pressed[:, 0] = np.searchsorted(buttons.clutch, times, side="right") % 2
        for column, presses in ((1, buttons.fixture), (2, buttons.mode)):
            for start in presses:
                pressed[(times >= start) & (times < start + 0.1), column] = 1.0
        return pressed

    def step(self) -> None:
        """One tick of 1 ms."""
        if self._used == BLOCK:
            self._block, self._used = self.draw(BLOCK), 0
        assert self._block is not None
        wanted, attitudes, noise, buttons = self._block
        i = self._used
        self._used += 1
        haptic_master_step(
            self.parameters, self.state, wanted[i], attitudes[i], noise[i], buttons[i], self.signals
        )


@kernel
def _turn_all(rest: Array, turns: Array, attitudes: Array) -> None:
    """Write the rest attitude turned by each rotation vector (N, 3) into ``attitudes`` (N, 4)."""
    for i in range(turns.shape[0]):
        rotate_by_vector(rest, turns[i, 0], turns[i, 1], turns[i, 2], attitudes[i])
