"""Haptic master, simulated: a Phantom Omni, and the mechanics of the hand that holds it."""

import math
from dataclasses import dataclass, field

import numpy as np

from teleop_core.base import Within, fill, fixed, parameter
from teleop_core.graph import DT, Noise, Row, RunningStage, Stage, assign, topics
from teleop_core.graph.operation import State
from teleop_core.hand.master import contact, hand_mechanics, rendering
from teleop_core.hand.master.device import (
    DeviceParameters,
    Handle,
    ReadingState,
    make_handle,
    measure_twist,
    read_handle,
    read_phantom,
)
from teleop_core.hand.operators.rest import REST_POSITION, REST_TILT, rest_pose
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.kernels import Array, PoseRow, inner, kernel, record, rotation, transform
from teleop_core.kernels.room import room

_DOUBT_NS = 1_000_000_000
"""Time for which forces are ignored after a force was out of range [ns]."""
_GRIP_NS = 300_000_000
"""Time for which the clutch stays pressed after a hand grips the stylus again [ns].

Within this time the hand brings the stylus to its wanted position.
"""
_FASTEST = 3.0  # a hand that moves faster between two samples has begun a new grip [m/s]
_NEAR = 2e-3  # a hand that moved by no more than this during a silence continues its grip [m]


@dataclass(frozen=True, kw_only=True)
class HapticMasterParameters:
    """Parameters of :class:`HapticMaster`."""

    seed: int = fixed(1, Within(0), "seed of everything random in the session")
    force_timeout: float = parameter(
        0.1, Within(0.002, 5.0, "s"), "if no servo_cf arrives for this time, the force becomes zero"
    )
    force_range: float = parameter(
        30.0,
        Within(0.1, 1000.0, "N"),
        "a larger servo_cf is taken as a sensor fault: the force is zero until servo_cf was smaller for 1 s",
        source="assumed: no stage asks for more than 20 N, and no such device gives more than 10 N",
    )
    hand_timeout: float = parameter(
        0.5,
        Within(0.02, 60.0, "s"),
        "if no hand/servo_cp arrives for this time, the stylus stays in place and the clutch is "
        "pressed; if the hand returns at another pose, the clutch stays pressed for 0.3 s more",
        source="assumed: the same time as for buttons; a busy machine delays a process for less",
    )
    device: DeviceParameters = field(default_factory=DeviceParameters)
    hand: hand_mechanics.HandParameters = field(default_factory=hand_mechanics.HandParameters)


class MasterRecord(HapticMasterParameters, hand_mechanics.HandRecord, rendering.RenderingRecord):
    """Parameter record of the haptic master."""

    silence_ns: int  # of the hand


def derive(p: MasterRecord, parameters: HapticMasterParameters, dt: float) -> None:
    """Write what follows from the parameters and the tick [s]."""
    device = parameters.device
    p.warming = -math.expm1(-dt / device.thermal_time)
    hand_mechanics.join(p, parameters.hand, device, dt)
    p.silence_ns = round(parameters.hand_timeout * 1e9)
    p.center[:] = np.subtract(REST_POSITION, device.start)
    p.half[:] = 0.5 * np.array(device.workspace)


class MasterState(hand_mechanics.HandState, ReadingState, rendering.RenderingState, contact.HandContactState):
    """State record of the haptic master."""

    next_noise: int
    aim: PoseRow  # pose of the stylus that the operator wants
    told_ns: int
    heard_ns: int
    free_ns: int
    is_held: int
    is_stopped: int
    doubted_ns: int
    doubted: float  # force that was out of range [N]


_STATE_OF_SLAVE, _FAULT = topics.OPERATION.index("state"), int(State.FAULT)
_MOST = topics.MASTER_CONTACT.columns.index("largest_force")


@inner
def _is_sound(p: MasterRecord, s: MasterState, force: Array, now_ns: int) -> bool:
    """Whether the force (6,) may be applied: the command was within its range for the last second, and is so now."""
    square = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
    if not square <= p.force_range * p.force_range:  # also for NaN
        s.doubted_ns, s.doubted = now_ns, square**0.5
    elif s.doubted_ns != 0 and now_ns - s.doubted_ns > _DOUBT_NS:
        s.doubted_ns = 0
    return bool(s.doubted_ns == 0)


@inner
def _holds(p: MasterRecord, s: MasterState, row: Row) -> bool:
    """Return whether a hand holds the stylus; if so, store its wanted pose.

    A hand that jumps, or that is at another position after a silence, begins a new grip. It then brings the stylus to
    its wanted pose before the clutch is released.
    """
    silence_ns = row.now_ns - s.heard_ns
    if row.hand_servo_cp_ns != s.told_ns:
        reach = _FASTEST * max(1e-9 * silence_ns if s.told_ns > 0 else 0.0, 1e-3)
        if s.told_ns > 0 and silence_ns > p.silence_ns:
            reach = _NEAR
        if contact.distance(s.aim, row.hand_servo_cp) > reach:
            s.free_ns = row.now_ns
        s.told_ns, s.heard_ns, silence_ns = row.hand_servo_cp_ns, row.now_ns, 0
        for i in range(7):
            s.aim[i] = row.hand_servo_cp[i]
    is_new = s.free_ns > 0 and row.now_ns - s.free_ns < _GRIP_NS
    s.is_held = 0 if silence_ns > p.silence_ns or is_new else 1
    return s.is_held > 0


@kernel
def haptic_master_step(p: MasterRecord, s: MasterState, handle: Handle, noises: Array, row: Row, dt: float) -> None:
    """One tick: apply master_servo_cf, move the device, and write its measurements and the contact.

    Args:
        p: Parameter record.
        s: State record; written.
        handle: None for the Phantom; otherwise the result of :func:`teleop_core.hand.master.device.make_handle`.
        noises: Standard normal numbers of the coming ticks (N, 6); the last three are noise of the gimbal's readings.
        row: Signals.
        dt: Tick [s].
    """
    is_sound = _is_sound(p, s, row.master_servo_cf, row.now_ns)
    if s.is_stopped or not is_sound or row.slave_operation[_STATE_OF_SLAVE] == _FAULT:
        for i in range(row.master_servo_cf.shape[0]):
            row.master_servo_cf[i] = 0.0
    is_held = _holds(p, s, row)
    noise, force = noises[s.next_noise], room(3)
    s.next_noise += 1
    before, place = room(3), room(3)
    row.master_contact[_MOST] = rendering.render(p, s, row.master_servo_cf, force)
    for i in range(3):
        before[i] = s.position[i]
    hand_mechanics.move_hand(p, s, s.aim[0:3], force, dt)
    for i in range(3):
        place[i] = s.position[i] + row.hand_tremor[i]
    contact.account(s, force, p.device.friction, contact.distance(before, s.position), place, row.master_contact)
    if handle is None:
        read_phantom(p.device, place, s.aim[3:7], noise[3:6], row.master_measured_cp)
    else:
        read_handle(handle, place, s.aim[3:7], row.master_measured_cp)
    measure_twist(s, row.master_measured_cp, row.master_measured_cv, dt)
    for i in range(3):
        row.master_measured_cf[i] = force[i]
        row.master_measured_cf[3 + i] = 0.0
        row.master_buttons[i] = row.hand_buttons[i]
    if not is_held:
        row.master_buttons[0] = 1.0


class HapticMaster(RunningStage):
    """Stage that simulates the device and the mechanics of the hand.

    The same parameters, hand and forces give the same motion, bit for bit.

    Args:
        parameters: Parameters of device and hand.
        dt: Length of a tick [s].
    """

    def __init__(self, parameters: HapticMasterParameters, dt: float = DT) -> None:
        super().__init__(HAPTIC_MASTER, 0, dt)
        self.parameters, self.state = record(MasterRecord), record(MasterState)
        self._noise = Noise()
        self._fixed = parameters
        self.kernel = haptic_master_step
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Put the stylus into the inkwell, restart the random numbers from the seed, and wait for a hand."""
        rng = np.random.default_rng(self._fixed.seed)
        rng.uniform(0.0, 2.0 * math.pi, PHASES)  # skip the random numbers that the operator takes from the same seed
        self._noise.begin(rng)
        rest = transform(rotation("x", REST_TILT), np.array(REST_POSITION))
        self.handle = make_handle(self._fixed.device, rest)
        self.arguments = (self.parameters, self.state, self.handle, self._noise.rows)
        self._bound = None
        assign(self.state, 0)
        self.signals["master_contact"] = 0.0
        for name in ("position", "hand", "wanted", "tip"):
            self.state[name] = REST_POSITION
        self.state["aim"] = self.signals["hand_servo_cp"] = rest_pose()
        self.signals["hand_buttons"] = self.signals["hand_tremor"] = 0.0
        place, pose = self.state["position"], self.signals["master_measured_cp"]
        if self.handle is None:
            read_phantom(self.parameters.device, place, self.state["aim"][3:], np.zeros(3), pose)
        else:
            read_handle(self.handle, place, self.state["aim"][3:], pose)
        self.state["reading"], self.state["attitude"] = pose[:3], pose[3:]

    def retune(self, parameters: HapticMasterParameters) -> None:
        """Take new device and hand parameters from the next tick on."""
        fill(self.parameters, parameters)
        derive(self.parameters, parameters, self.dt)

    def press(self, *, is_pressed: bool) -> None:
        """While an emergency stop is pressed, apply no force, from the next tick on."""
        self.state["is_stopped"] = is_pressed

    @property
    def doubted_force(self) -> float:
        """Rejected force that was out of range [N]; 0 if there is none."""
        return float(self.state["doubted"]) if self.state["doubted_ns"] else 0.0

    @property
    def is_held(self) -> bool:
        """Whether a hand holds the stylus."""
        return bool(self.state["is_held"])

    def prepare(self, ticks: int) -> None:
        """Draw the noise of the next ticks."""
        self._noise.prepare(self.state, ticks)


HAPTIC_MASTER = Stage(
    "haptic_master",
    HapticMasterParameters,
    reads=(
        topics.HAND_SERVO_CP,
        topics.HAND_BUTTONS,
        topics.HAND_TREMOR,
        topics.MASTER_SERVO_CF,
        topics.SLAVE_OPERATION,
    ),
    writes=(
        topics.MASTER_MEASURED_CP,
        topics.MASTER_MEASURED_CV,
        topics.MASTER_MEASURED_CF,
        topics.MASTER_BUTTONS,
        topics.MASTER_CONTACT,
    ),
    late=(topics.MASTER_SERVO_CF, topics.SLAVE_OPERATION),
    make=HapticMaster,
    node="teleop_core.nodes.haptic_master:HapticMasterNode",
)
