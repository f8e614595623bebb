"""Operator: a simulated person who moves the stylus, presses its buttons, and sees what a real person would see."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from teleop_core.base import PartError, TeleopError, fill
from teleop_core.graph import DT, STATE, Noise, Row, RunningStage, Stage, assign, topics
from teleop_core.graph.noise import BLOCK
from teleop_core.hand.operators import OPERATORS, Seen, Setting, follower
from teleop_core.hand.operators.behaviour import PRESS_TIME, OperatorParameters
from teleop_core.hand.operators.remote import RemoteHand
from teleop_core.hand.operators.rest import REST_POSITION, rest_pose
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.kernels import Array, Fields, Vector3, inner, kernel, record, record_array
from teleop_core.kernels.geometry import rotate_by_vector
from teleop_core.kernels.room import room


class OperatorRecord(OperatorParameters, Fields):
    """Parameter record of the operator."""

    tremor: float  # amplitude of the tremor; 0 if the wanted motion contains it [m]
    patience_ns: int


def derive(p: OperatorRecord, parameters: OperatorParameters, kind: str) -> None:
    """Write what follows from the parameters and from the kind of the operator."""
    p.tremor = 0.0 if OPERATORS.find(kind).trembles else parameters.tremor_amplitude
    p.patience_ns = round(parameters.patience * 1e9)


class OperatorState(Fields):
    """State record of the operator."""

    phase: Vector3  # phase of the tremor [rad]
    wander: Vector3
    next: int
    next_noise: int
    has_begun: int
    first_ns: int


_IS_FOLLOWING = STATE["is_following"]


@inner
def _begins(p: OperatorRecord, s: OperatorState, row: Row) -> bool:
    """Whether the operator moves the hand: once the slave has followed, or the operator's patience has ended.

    A state older than the first sample belongs to another master.
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
def tremble(p: OperatorRecord, s: OperatorState, noise: Array, tremor: Array, dt: float) -> None:
    """Write the wanted tremor (3,) [m]: one sine per axis whose frequency varies within its band."""
    for i in range(3):
        # Ornstein-Uhlenbeck process with unit variance and a time constant of half a second.
        s.wander[i] += -s.wander[i] * (dt / 0.5) + noise[i] * math.sqrt(2.0 * dt / 0.5)
        width = min(2.0, p.tremor_frequency - 8.0, 12.0 - p.tremor_frequency)
        s.phase[i] += 2.0 * math.pi * dt * (p.tremor_frequency + width * math.tanh(s.wander[i]))
        tremor[i] = p.tremor * math.sin(s.phase[i])


@kernel
def operator_step(
    p: OperatorRecord, s: OperatorState, wanted: Sequence[follower.Wanted], noises: Array, row: Row, dt: float
) -> None:
    """One tick: write the wanted pose of the hand, its tremor and the buttons.

    The hand rests until the slave follows, as a person's hand would. So the slave follows the whole motion.

    Args:
        p: Parameter record.
        s: State record; written.
        wanted: One record for this tick and each coming tick: ``wanted`` position (3,) [m] in the master's base;
            ``attitude`` of the stylus, quaternion (4,); ``buttons`` (3,): clutch, fixture, mode; ``tremor`` (3,) [m] of
            the tip, independent of friction and force; ``jaw``, the closing of the jaw.
        noises: Standard normal numbers of the coming ticks (N, 6), of which x, y, z are the tremor's noise.
        row: Signals.
        dt: Tick [s].
    """
    if _begins(p, s, row):
        s.next += 1
    now, tremor = wanted[s.next], room(3)
    tremble(p, s, noises[s.next_noise], tremor, dt)
    s.next_noise += 1
    for i in range(3):
        row.hand_servo_cp[i] = now.wanted[i] + tremor[i]
        row.hand_tremor[i] = now.tremor[i]
        row.hand_buttons[i] = now.buttons[i]
    row.hand_jaw[0] = now.jaw
    for i in range(4):
        row.hand_servo_cp[3 + i] = now.attitude[i]


class RunningOperator(RunningStage):
    """Stage of the operator.

    The same parameters give the same motion, bit for bit, unless the operator reacts to what it sees.

    Args:
        parameters: Parameters of the operator.
        dt: Length of a tick [s].

    Raises:
        TeleopError: The operator cannot be made, for example because its recording is missing.
    """

    def __init__(self, parameters: OperatorParameters, dt: float = DT) -> None:
        super().__init__(OPERATOR, 0, dt)
        self.parameters, self.state = record(OperatorRecord), record(OperatorState)
        # The first record of ``wanted`` is that of the present tick.
        self._wanted, self._noise = record_array(follower.Wanted, BLOCK + 1), Noise()
        self._fixed = parameters
        self.kernel = operator_step
        self.arguments = (self.parameters, self.state, self._wanted, self._noise.rows)
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Put the stylus into the inkwell, at time zero, and restart the random numbers from the seed."""
        fixed, row = self._fixed, self.signals
        rng = np.random.default_rng(fixed.seed)
        phases = rng.uniform(0.0, 2.0 * math.pi, PHASES)
        self._operator = OPERATORS.find(fixed.kind.kind)
        self.ahead = min(self._operator.ahead, BLOCK)
        seen = Seen._make((*(row[topic.field] for topic in OPERATOR.reads), self._age))
        setting = Setting(fixed, phases, fixed.seed, seen)
        self._motion = self._asked(self._operator.make, fixed.kind.parameters, setting)
        buttons = fixed.buttons
        has_presses = bool(buttons.clutch or buttons.fixture or buttons.mode or buttons.jaw)
        self._has_presses, self._person = has_presses, None if has_presses else self.hand
        self._noise.begin(rng)
        self._tick, self._end = 0, 1
        assign(self.state, 0)
        now, rest = self._wanted[0], rest_pose()
        self._rest = rest[3:]
        now["wanted"], now["attitude"], now["buttons"] = rest[:3], rest[3:], 0.0
        now["tremor"] = now["jaw"] = 0.0
        row[topics.HAND_SERVO_CP.field], row[topics.MASTER_MEASURED_CP.field] = rest, rest
        row[topics.HAND_BUTTONS.field] = row[topics.HAND_TREMOR.field] = row[topics.HAND_JAW.field] = 0.0

    def retune(self, parameters: OperatorParameters) -> None:
        """Use new values of tremor and patience from the next tick on; the motion continues."""
        fill(self.parameters, parameters)
        derive(self.parameters, parameters, self._fixed.kind.kind)

    @property
    def has_begun(self) -> bool:
        """Whether the operator has begun to move the hand."""
        return bool(self.state["has_begun"])

    @property
    def hand(self) -> RemoteHand | None:
        """Remote hand, which takes wanted poses of the stylus; None if the operator has no such hand.

        :meth:`reset` makes a new hand.
        """
        return self._motion if isinstance(self._motion, RemoteHand) else None

    def prepare(self, ticks: int) -> None:
        """Compute the wanted motion of the next ticks, of as many as the operator allows at once."""
        self._noise.prepare(self.state, ticks)
        now = int(self.state["next"])
        left = self._end - now  # number of remaining records, including that of the present tick
        if left > ticks:
            return
        # copy whole records, because copying each field is slow
        as_bytes = self._wanted.view(np.dtype((np.void, self._wanted.itemsize)))
        as_bytes[:left] = as_bytes[now : self._end]
        self._end = max(ticks, min(left - 1 + self._operator.ahead, BLOCK)) + 1
        self.state["next"] = 0
        self._draw(self._wanted[left : self._end])

    def _age(self) -> float:
        """Time since the slave's pose was measured that the operator sees [s]; infinite before the first pose."""
        stamp_ns = int(self.signals[f"{topics.SLAVE_MEASURED_CP.field}_ns"])
        return 1e-9 * (int(self.signals["now_ns"]) - stamp_ns) if stamp_ns > 0 else math.inf

    def _draw(self, drawn: Any) -> None:
        count = len(drawn)
        if self._person is not None and count <= follower.MOST:  # faster than through rotation vectors
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
        drawn["buttons"] = np.maximum(self._pressed(times) if self._has_presses else 0.0, moves[:, 6:9])
        drawn["tremor"] = moves[:, 9:12]
        closed = _held(self._fixed.buttons.jaw, times) if self._has_presses else 0.0
        drawn["jaw"] = np.maximum(closed, np.minimum(moves[:, 12], 1.0))

    def _moves(self, times: Array) -> Array:
        """Motion, buttons, tremor and jaw (N, 13) of the operator.

        Raises:
            PartError: The operator's answer has the wrong shape, or is not finite.
        """
        name = self._fixed.kind.kind
        moves = np.asarray(self._asked(self._motion, times))
        if moves.dtype.kind not in "fiub":
            raise PartError("operator", name, f"one whose motion is numbers, not {moves.dtype}")
        moves = moves.astype(np.float64, copy=False)
        if moves.shape not in {(len(times), columns) for columns in (3, 6, 9, 12, 13)}:
            text = f"one whose motion has the shape (N, 3), (N, 6) or (N, 9) for N times, not {moves.shape}"
            raise PartError("operator", name, text)
        if not np.isfinite(moves).all():
            bad = times[int(np.flatnonzero(~np.isfinite(moves).all(axis=1))[0])]
            raise PartError("operator", name, f"one whose motion is finite; at {bad:g} s it is not")
        whole = np.zeros((len(times), 13))
        whole[:, : moves.shape[1]] = moves
        return whole

    def _asked(self, question: Callable[..., Any], *arguments: Any) -> Any:
        """Return the operator's answer.

        Raises:
            PartError: The operator raises an exception. A TeleopError is passed on unchanged.
        """
        try:
            return question(*arguments)
        except TeleopError:
            raise
        except Exception as error:  # one line names the operator for any exception that a user's operator raises
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
            text = "one with make(parameters, setting) -> motion and motion(times) -> rows"
            name = self._fixed.kind.kind
            raise PartError("operator", name, f"{text}; it raises {reason}") from error

    def _pressed(self, times: Array) -> Array:
        buttons = self._fixed.buttons
        pressed = np.zeros((len(times), 3))
        pressed[:, 0] = _held(buttons.clutch, times)
        for column, presses in ((1, buttons.fixture), (2, buttons.mode)):
            for start in presses:
                pressed[(times >= start) & (times < start + PRESS_TIME), column] = 1.0
        return pressed


def _held(presses: tuple[float, ...], times: Array) -> Array:
    """Whether a button is held at times (N,) [s]; ``presses`` are its alternating press and release times."""
    return (np.searchsorted(presses, times, side="right") % 2).astype(np.float64)


@kernel
def _turn_all(rest: Array, turns: Array, attitudes: Array) -> None:
    """Rotate the rest attitude by each rotation vector (N, 3); the results are written to ``attitudes`` (N, 4)."""
    for i in range(turns.shape[0]):
        rotate_by_vector(rest, turns[i, 0], turns[i, 1], turns[i, 2], attitudes[i])


OPERATOR = Stage(
    "operator",
    OperatorParameters,
    reads=(
        topics.SLAVE_MEASURED_CP,
        topics.MASTER_MEASURED_CP,
        topics.MASTER_MEASURED_CF,
        topics.TELEOP_STATE,
        topics.TASK_STATE,
    ),
    writes=(topics.HAND_SERVO_CP, topics.HAND_BUTTONS, topics.HAND_TREMOR, topics.HAND_JAW),
    late=(
        topics.SLAVE_MEASURED_CP,
        topics.MASTER_MEASURED_CP,
        topics.MASTER_MEASURED_CF,
        topics.TELEOP_STATE,
        topics.TASK_STATE,
    ),
    optional=(topics.TASK_STATE,),
    on_demand=(topics.HAND_JAW,),
    make=RunningOperator,
    node="teleop_core.nodes.operator:OperatorNode",
)
