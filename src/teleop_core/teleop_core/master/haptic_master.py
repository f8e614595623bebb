"""Haptic master, simulated: a Phantom Omni in the hand of an operator."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from teleop_core.errors import ParameterError, PartError, TeleopError
from teleop_core.geometry import (
    Array,
    quaternion_from_rotation,
    rotate_by_vector,
    rotation,
    transform,
)
from teleop_core.kernels import inner, kernel, records
from teleop_core.master.contact import CONTACT_STATE, account, distance
from teleop_core.master.device import (
    DeviceParameters,
    make_handle,
    measure_twist,
    read_handle,
    read_phantom,
)
from teleop_core.master.hand import HAND_PARAMETERS, HandParameters, join, move_hand, tremble
from teleop_core.master.rendering import RENDERING_PARAMETERS, RENDERING_STATE, render
from teleop_core.operation.states import State
from teleop_core.operators import OPERATORS, Setting
from teleop_core.operators.follower import MOST, WANTED
from teleop_core.operators.parameters import OperatorParameters
from teleop_core.operators.remote import RemoteHand
from teleop_core.operators.rest import REST_POSITION, REST_TILT
from teleop_core.operators.shapes import PHASES
from teleop_core.parameters import parameter
from teleop_core.signals import DT, STATE, assign
from teleop_core.stage import RunningStage, Stage
from teleop_core.topics import (
    MASTER_BUTTONS,
    MASTER_CONTACT,
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    MASTER_MEASURED_CV,
    MASTER_SERVO_CF,
    OPERATION,
    SLAVE_OPERATION,
    TELEOP_STATE,
)

BLOCK = 1000
"""Ticks for which the wanted motion and the noise are drawn at once, at most."""
_DOUBT_NS = 1_000_000_000
"""Time for which a source of force is not believed after it was out of range [ns]."""
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
    force_range: float = parameter(
        30.0, unit="N", lower=0.1, upper=1000.0,
        doc="a servo_cf beyond it comes from a broken sensor: no force until it was within for 1 s",
        source="assumed: no stage asks for more than 20 N, no such device gives more than 10",
    )  # fmt: skip
    patience: float = parameter(
        10.0, unit="s", lower=0.0, upper=3600.0, fixed=True,
        doc="the operator begins when teleop/state says that the slave follows, or after this",
    )  # fmt: skip
    device: DeviceParameters = field(default_factory=DeviceParameters)
    hand: HandParameters = field(default_factory=HandParameters)
    operator: OperatorParameters = field(default_factory=OperatorParameters)
    buttons: ButtonParameters = field(default_factory=ButtonParameters)


_PARAMETERS = [
    *((name, "f8") for name in ("resolution", "gimbal", "tremor", "frequency", "force_range")),
    ("center", "f8", (3,)), ("half", "f8", (3,)), ("patience_ns", "i8"),
    *HAND_PARAMETERS, *RENDERING_PARAMETERS,
]  # fmt: skip
_STATE = [
    *((name, "f8", (3,)) for name in ("position", "speed", "hand", "hand_speed", "wanted",
      "phase", "wander", "reading", "rate", "turning")),
    ("attitude", "f8", (4,)), ("next", "i8"), ("next_noise", "i8"), ("has_begun", "i8"),
    ("first_ns", "i8"), ("is_stopped", "i8"), ("doubted_ns", "i8"), ("doubted", "f8"),
    *RENDERING_STATE, *CONTACT_STATE,
]  # fmt: skip
_STATE_OF_SLAVE, _FAULT = OPERATION.index("state"), int(State.FAULT)
_IS_FOLLOWING = STATE["is_following"]
_MOST = MASTER_CONTACT.columns.index("largest_force")


@inner
def _begins(p: Any, s: Any, row: Any) -> bool:
    """Whether the operator moves the hand: since the slave first followed, or lost patience.

    A state that is older than the first sample is about another master.
    """
    if s.first_ns == 0:
        s.first_ns = row.now_ns
    is_about_us = row.teleop_state_ns >= s.first_ns
    if is_about_us and row.teleop_state[_IS_FOLLOWING] > 0.0:
        s.has_begun = 1
    if row.now_ns - s.first_ns >= p.patience_ns:
        s.has_begun = 1
    return s.has_begun > 0


@inner
def _is_sound(p: Any, s: Any, force: Array, now_ns: int) -> bool:
    """Whether the force (6,) can be given: within its range now, and in the last second."""
    square = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
    if not square <= p.force_range * p.force_range:  # NaN is not
        s.doubted_ns, s.doubted = now_ns, square**0.5
    elif s.doubted_ns != 0 and now_ns - s.doubted_ns > _DOUBT_NS:
        s.doubted_ns = 0
    return bool(s.doubted_ns == 0)


@kernel
def haptic_master_step(
    p: Any, s: Any, handle: Any, wanted: Any, noises: Any, row: Any, dt: float
) -> None:
    """One tick: feel master_servo_cf, move, and write what the device measures and the contact.

    Until the slave follows the hand rests, as an operator's would: none of its motion is lost.

    Args:
        p: Parameter record.
        s: State record; written.
        handle: None for the Phantom, else as :func:`teleop_core.master.device.make_handle` gives.
        wanted: What the operator wants, now and in the coming ticks, record by record:
            ``wanted`` (3,) [m] in the master's base, ``attitude`` of the stylus, quaternion (4,),
            ``buttons`` (3,): clutch, fixture, mode, and ``tremor`` (3,) [m], which the tip makes
            whatever friction and force are.
        noises: Standard normal numbers of the coming ticks (N, 6) for tremor x, y, z and gimbal
            x, y, z.
        row: Signals.
        dt: Tick [s].
    """
    is_sound = _is_sound(p, s, row.master_servo_cf, row.now_ns)
    if s.is_stopped or not is_sound or row.slave_operation[_STATE_OF_SLAVE] == _FAULT:
        for i in range(row.master_servo_cf.shape[0]):
            row.master_servo_cf[i] = 0.0
    if _begins(p, s, row):
        s.next += 1
    now, noise, force = wanted[s.next], noises[s.next_noise], np.empty(3)
    s.next_noise += 1
    tremor, before, place = np.empty(3), np.empty(3), np.empty(3)
    row.master_contact[_MOST] = render(p, s, row.master_servo_cf, force)
    tremble(p, s, noise, tremor, dt)
    for i in range(3):
        before[i] = s.position[i]
        tremor[i] += now.wanted[i]
    move_hand(p, s, tremor, force, dt)
    for i in range(3):
        place[i] = s.position[i] + now.tremor[i]
    account(s, force, p.friction, distance(before, s.position), place, row.master_contact)
    if handle is None:
        read_phantom(p, place, now.attitude, noise[3:6], row.master_measured_cp)
    else:
        read_handle(handle, place, now.attitude, row.master_measured_cp)
    measure_twist(s, row.master_measured_cp, row.master_measured_cv, dt)
    for i in range(3):
        row.master_measured_cf[i] = force[i]
        row.master_measured_cf[3 + i] = 0.0
        row.master_buttons[i] = now.buttons[i]


class HapticMaster(RunningStage):
    """Stage that simulates device and operator.

    The same parameters give the same motion, bit for bit, as long as the same forces act on it.

    Args:
        parameters: What device, hand and operator are.
        dt: Length of a tick [s].

    Raises:
        TeleopError: The operator cannot be made, as one whose recording is missing.
    """

    def __init__(self, parameters: HapticMasterParameters, dt: float = DT) -> None:
        super().__init__(HAPTIC_MASTER, 0, dt)
        self.parameters, self.state = records(_PARAMETERS)[0], records(_STATE)[0]
        # The first record of what is wanted is that of the present tick.
        self._wanted, self._noises = records(WANTED, BLOCK + 1), np.zeros((BLOCK, 6))
        self._fixed = parameters
        self.kernel = haptic_master_step
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Stylus in the inkwell, at time zero, with the random numbers of the seed."""
        wanted = self._fixed.operator
        self._rng = np.random.default_rng(self._fixed.seed)
        phases = self._rng.uniform(0.0, 2.0 * math.pi, PHASES)
        self._operator = OPERATORS.find(wanted.kind.kind)
        self.ahead = min(self._operator.ahead, BLOCK)
        setting = Setting(wanted, phases, self._fixed.seed, self._fixed.device)
        self._motion = self._asked(self._operator.make, wanted.kind.parameters, setting)
        buttons = self._fixed.buttons
        has_presses = bool(buttons.clutch or buttons.fixture or buttons.mode)
        self._person = None if has_presses else self.hand
        self._tick, self._end, self._end_of_noise = 0, 1, 0
        self._rest = np.empty(4)
        quaternion_from_rotation(rotation("x", REST_TILT), self._rest)
        rest = transform(rotation("x", REST_TILT), np.array(REST_POSITION))
        self.handle = make_handle(self._fixed.device, rest)
        self.arguments = (self.parameters, self.state, self.handle, self._wanted, self._noises)
        self._bound = None
        assign(self.state, 0)
        self.signals["master_contact"] = 0.0
        for name in ("position", "hand", "wanted", "tip"):
            self.state[name] = REST_POSITION
        now = self._wanted[0]
        now["wanted"], now["attitude"], now["buttons"] = REST_POSITION, self._rest, 0.0
        now["tremor"] = 0.0
        place, pose = self.state["position"], self.signals["master_measured_cp"]
        if self.handle is None:
            read_phantom(self.parameters, place, self._rest, np.zeros(3), pose)
        else:
            read_handle(self.handle, place, self._rest, pose)
        self.state["reading"], self.state["attitude"] = pose[:3], pose[3:]

    def retune(self, parameters: HapticMasterParameters) -> None:
        """Take new device and hand parameters from the next tick on; the operator goes on."""
        p, device, hand = self.parameters, parameters.device, parameters.hand
        p["resolution"], p["gimbal"] = device.position_resolution, device.gimbal_noise
        p["friction"], p["peak_force"] = device.friction, device.peak_force
        p["continuous"] = device.continuous_force
        p["warming"] = -math.expm1(-self.dt / device.thermal_time)
        p["device_stiffness"] = device.stiffness
        p["device_damping"] = device.structure_damping
        p["mass"], p["device_mass"] = hand.mass, device.apparent_mass
        p["stiffness"], p["damping"] = hand.stiffness, hand.damping
        join(p, self.dt)
        operator = OPERATORS.find(self._fixed.operator.kind.kind)
        p["tremor"] = 0.0 if operator.trembles else hand.tremor_amplitude
        p["frequency"] = hand.tremor_frequency
        p["force_range"] = parameters.force_range
        p["patience_ns"] = round(parameters.patience * 1e9)
        p["center"] = np.subtract(REST_POSITION, device.start)
        p["half"] = 0.5 * np.array(device.workspace)

    def press(self, *, is_pressed: bool) -> None:
        """Give no force from the next tick on while an emergency stop is pressed."""
        self.state["is_stopped"] = is_pressed

    @property
    def doubted_force(self) -> float:
        """Force that was out of range and is not believed [N]; 0 while all is well."""
        return float(self.state["doubted"]) if self.state["doubted_ns"] else 0.0

    @property
    def has_begun(self) -> bool:
        """Whether the operator moves the hand yet."""
        return bool(self.state["has_begun"])

    @property
    def hand(self) -> RemoteHand | None:
        """Hand of a person, to be told where the stylus shall be; None if the operator has none.

        After :meth:`reset` it is another one.
        """
        return self._motion if isinstance(self._motion, RemoteHand) else None

    def prepare(self, ticks: int) -> None:
        """Draw what the operator wants in the next ticks, as far ahead as he can be asked."""
        self._prepare_noise(ticks)
        now = int(self.state["next"])
        left = self._end - now  # with the record of the present tick
        if left > ticks:
            return
        self._wanted[:left] = self._wanted[now : self._end]
        self._end = max(ticks, min(left - 1 + self._operator.ahead, BLOCK)) + 1
        self.state["next"] = 0
        self._draw(self._wanted[left : self._end])

    def _prepare_noise(self, ticks: int) -> None:
        first = int(self.state["next_noise"])
        left = self._end_of_noise - first
        if left >= ticks:
            return
        self._noises[:left] = self._noises[first : self._end_of_noise]
        self._end_of_noise = BLOCK
        self.state["next_noise"] = 0
        self._noises[left:] = self._rng.standard_normal((BLOCK - left, 6))

    def _draw(self, drawn: Any) -> None:
        """Fill records with what the operator wants in the ticks that follow."""
        count = len(drawn)
        if self._person is not None and count <= MOST:  # faster than by way of turns
            drawn[:] = self._person.draw((self._tick + 1) * self.dt, self.dt, count)
            self._tick += count
            return
        times = np.arange(self._tick + 1, self._tick + count + 1, dtype=np.float64) * self.dt
        self._tick += count
        moves = self._moves(times)
        drawn["wanted"] = moves[:, :3] + REST_POSITION
        attitudes = np.empty((count, 4))
        _turn_all(self._rest, np.ascontiguousarray(moves[:, 3:6]), attitudes)
        drawn["attitude"] = attitudes
        drawn["buttons"] = np.maximum(self._pressed(times), moves[:, 6:9])
        drawn["tremor"] = moves[:, 9:]

    def _moves(self, times: Array) -> Array:
        """Motion, buttons and tremor (N, 12) of the operator.

        Raises:
            PartError: What he answers has another shape, or is not finite.
        """
        name = self._fixed.operator.kind.kind
        moves = np.asarray(self._asked(self._motion, times))
        if moves.dtype.kind not in "fiub":
            raise PartError("operator", name, f"one who answers numbers, not {moves.dtype}")
        moves = moves.astype(np.float64)
        if moves.shape not in {(len(times), columns) for columns in (3, 6, 9, 12)}:
            text = f"one who answers (N, 3), (N, 6) or (N, 9) for N times, not {moves.shape}"
            raise PartError("operator", name, text)
        if not np.isfinite(moves).all():
            bad = times[int(np.flatnonzero(~np.isfinite(moves).all(axis=1))[0])]
            raise PartError("operator", name, f"one who answers finite numbers; at {bad:g} s not")
        if moves.shape[1] == 12:
            return moves
        return np.pad(moves, ((0, 0), (0, 12 - moves.shape[1])))

    def _asked(self, question: Callable[..., Any], *arguments: Any) -> Any:
        """Answer of the operator.

        Raises:
            PartError: He raises; an error of ours is passed on as it is.
        """
        try:
            return question(*arguments)
        except TeleopError:
            raise
        except Exception as error:  # whatever a foreign operator raises, one line names him
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
            text = "one with make(parameters, setting) -> motion and motion(times) -> rows"
            name = self._fixed.operator.kind.kind
            raise PartError("operator", name, f"{text}; it raises {reason}") from error

    def _pressed(self, times: Array) -> Array:
        buttons = self._fixed.buttons
        pressed = np.zeros((len(times), 3))
        pressed[:, 0] = np.searchsorted(buttons.clutch, times, side="right") % 2
        for column, presses in ((1, buttons.fixture), (2, buttons.mode)):
            for start in presses:
                pressed[(times >= start) & (times < start + PRESS_TIME), column] = 1.0
        return pressed


@kernel
def _turn_all(rest: Array, turns: Array, attitudes: Array) -> None:
    """Write the rest attitude turned by each rotation vector (N, 3) into ``attitudes`` (N, 4)."""
    for i in range(turns.shape[0]):
        rotate_by_vector(rest, turns[i, 0], turns[i, 1], turns[i, 2], attitudes[i])


HAPTIC_MASTER = Stage(
    "haptic_master",
    HapticMasterParameters,
    reads=(MASTER_SERVO_CF, TELEOP_STATE, SLAVE_OPERATION),
    writes=(
        MASTER_MEASURED_CP, MASTER_MEASURED_CV, MASTER_MEASURED_CF, MASTER_BUTTONS, MASTER_CONTACT,
    ),
    late=(MASTER_SERVO_CF, TELEOP_STATE, SLAVE_OPERATION),
    make=HapticMaster,
    node="teleop_core.nodes.haptic_master:HapticMasterNode",
)  # fmt: skip
