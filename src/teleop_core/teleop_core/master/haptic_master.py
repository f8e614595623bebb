"""Haptic master, simulated: a Phantom Omni in the hand of an operator."""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from teleop_core.errors import ParameterError
from teleop_core.geometry import (
    Array,
    quaternion_from_rotation,
    rotate_by_vector,
    rotation,
    transform,
)
from teleop_core.kernels import kernel
from teleop_core.master.device import (
    DeviceParameters,
    make_handle,
    measure_twist,
    read_handle,
    read_phantom,
)
from teleop_core.master.hand import HandParameters, move_hand, tremble
from teleop_core.master.paths import Path, PathParameters
from teleop_core.parameters import parameter
from teleop_core.signals import DT, make_signals

# The stylus rests in the inkwell at this tilt about x (Vongbunyong 2008, table 6.1; its sign is
# the one that meets the slave's home), at this place in the master's base.
REST_TILT = math.radians(-23.4)
REST_POSITION = (0.0, -0.065511, -0.088114)
BLOCK = 1000
"""Ticks for which the wanted path and the noise are drawn at once."""
PRESS_TIME = 0.1
"""How long the operator presses the fixture or the mode button [s]."""


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
        for name, presses in (("fixture", self.fixture), ("mode", self.mode)):
            if any(b - a < PRESS_TIME + 0.01 for a, b in pairwise(sorted(presses))):
                raise ParameterError(f"buttons.{name}", presses, "at least 0.11 s apart")


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


@kernel
def haptic_master_step(
    p: Any,
    s: Any,
    handle: Any,
    wanted: Array,
    attitude: Array,
    noise: Array,
    buttons: Array,
    row: Any,
) -> None:
    """One tick: feel master_servo_cf, move, and write master_measured_cp, _cv, _cf and _buttons.

    Args:
        p: Parameter record.
        s: State record; written.
        handle: None for the Phantom, else as :func:`teleop_core.master.device.make_handle` gives.
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
    tremble(p, s, noise, tremor)
    for i in range(3):
        force[i] = share * command[i]
        tremor[i] += wanted[i]
    move_hand(p, s, tremor, force)
    if handle is None:
        read_phantom(p, s.position, attitude, noise[3:6], row.master_measured_cp)
    else:
        read_handle(handle, s.position, attitude, row.master_measured_cp)
    measure_twist(s, row.master_measured_cp, row.master_measured_cv)
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
        rest = transform(rotation("x", REST_TILT), np.array(REST_POSITION))
        self.handle = make_handle(self._fixed.device, rest)
        for name in _STATE.names or ():
            self.state[name] = 0.0
        for name in ("position", "wanted"):
            self.state[name] = REST_POSITION
        place, pose = self.state["position"], self.signals["master_measured_cp"]
        if self.handle is None:
            read_phantom(self.parameters, place, self._rest, np.zeros(3), pose)
        else:
            read_handle(self.handle, place, self._rest, pose)
        self.state["reading"], self.state["attitude"] = pose[:3], pose[3:]

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
                pressed[(times >= start) & (times < start + PRESS_TIME), column] = 1.0
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
            self.parameters,
            self.state,
            self.handle,
            wanted[i],
            attitudes[i],
            noise[i],
            buttons[i],
            self.signals,
        )


@kernel
def _turn_all(rest: Array, turns: Array, attitudes: Array) -> None:
    """Write the rest attitude turned by each rotation vector (N, 3) into ``attitudes`` (N, 4)."""
    for i in range(turns.shape[0]):
        rotate_by_vector(rest, turns[i, 0], turns[i, 1], turns[i, 2], attitudes[i])
