"""Motion scaling: from the master's pose to the slave's, with modes, clutch and fixture."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from teleop_core.base import fill
from teleop_core.coupling.architectures import ARCHITECTURES
from teleop_core.coupling.fixtures import Held, fixture_depth
from teleop_core.coupling.mapping import following, gains, limits, plausibility, side, walls
from teleop_core.coupling.mapping.reflection import (
    Law,
    ReflectionRecord,
    ReflectionState,
    lead_by_force,
    make_law,
    reflect,
)
from teleop_core.coupling.passivity import PASSIVITIES
from teleop_core.graph import DT, STATE, Row, RunningStage, Stage, assign, copy, topics
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.fields import Quaternion, Vector3, record, record_array
from teleop_core.kernels.geometry import Array, multiply_quaternions
from teleop_core.kernels.room import room


class ScalingRecord(gains.MotionScalingParameters, ReflectionRecord, limits.TurnRecord):
    """Parameter record of the motion scaling."""

    stylus_tool: Quaternion
    slave_master: Quaternion
    size: Vector3  # size of the fixture [m]
    spring: float  # stiffness of the fixture's wall [N/m]
    is_damped: int  # whether the wall is damped
    holds_hand: int  # whether the fixture confines the hand
    holds_slave: int
    reach_stiffness: float  # [N/m]
    reach_depth: float  # [m]
    silence_ns: int  # allowed silence of the buttons


def derive(p: ScalingRecord, parameters: gains.MotionScalingParameters) -> None:
    """Write what follows from the parameters."""
    fixture, force, reflection = parameters.fixture, parameters.reach_force, parameters.reflection
    axes, wall = axis_map("axes", parameters.axes), walls.WALLS[fixture.wall]
    p.gain[:] = parameters.coarse_gain, parameters.fine_gain
    p.axis[:], p.sign[:] = np.abs(axes).argmax(axis=1), axes.sum(axis=1)
    p.slave_master[:], p.stylus_tool[:], p.has_tool_axes = gains.tool_map(parameters)
    p.spring, p.is_damped = wall.spring(fixture.stiffness, fixture.max_force), wall.is_damped
    p.size[:] = fixture.made.size()
    p.holds_hand, p.holds_slave = fixture.side != "slave", fixture.side != "hand"
    stiffness = force.stiffness if force.is_on else 0.0
    p.reach_depth = force.max_force / stiffness if stiffness * force.max_force > 0.0 else _SHALLOW
    p.reach_stiffness = stiffness if force.max_force > 0.0 else 0.0
    law = ARCHITECTURES.find(reflection.architecture.kind)
    p.is_reflected = law.name != "unilateral"
    p.force_scale = law.force_scale(reflection.architecture.parameters)
    p.lead_gain = law.lead_gain(reflection.architecture.parameters)
    p.law = PASSIVITIES.names().index(reflection.passivity.kind)
    p.timeout_ns = round(parameters.feedback_timeout * 1e9)
    p.pause_ns = round(parameters.longest_pause * 1e9)
    p.silence_ns = round(parameters.plausible.button_silence * 1e9)


class ScalingState(
    limits.LimitState,
    walls.WallState,
    side.SideState,
    plausibility.PlausibilityState,
    ReflectionState,
    following.FollowingState,
):
    """State record of the motion scaling."""

    buttons: Vector3
    is_fine: int
    must_latch: int
    is_fixture_on: int
    stylus: Vector3
    has_led: int  # whether the last sample moved the slave
    aligned: int  # number of times that hand and slave were aligned again


_FOLLOWING, _CLUTCHED = STATE["is_following"], STATE["is_clutched"]
_FINE, _GAIN, _FIXTURE = STATE["is_fine"], STATE["gain"], STATE["is_fixture_on"]
_CENTER, _SIZE = STATE["fixture_center_x"], STATE["fixture_size_x"]
_LIMIT, _JOINT = STATE["limit"], STATE["limited_joint"]
# Depth [m] up to which the hand's depth beyond a limit is measured if no force is felt.
_SHALLOW = 2e-3
# Assumed period of the first sample [s].
_LONG = 1e-3


@kernel
def to_slave_axes(p: ScalingRecord, master: Array, slave: Array) -> None:
    """Rotate a vector (3,) from the master's base to the slave's axes, and write it into ``slave``."""
    x, y, z = (p.sign[0] * master[p.axis[0]], p.sign[1] * master[p.axis[1]], p.sign[2] * master[p.axis[2]])
    slave[0], slave[1], slave[2] = x, y, z


@kernel
def mapped_orientation(p: ScalingRecord, stylus: Array, tool: Array) -> None:
    """Write the quaternion of the slave's tool that corresponds to a stylus quaternion, before alignment."""
    multiply_quaternions(p.slave_master, stylus, tool)
    multiply_quaternions(tool, p.stylus_tool, tool)


@inner
def _take_tool(p: ScalingRecord, s: ScalingState, pose: Array, turn: Array) -> None:
    """Store the orientation that the hand commands, and its rotation if only a share of it is used."""
    if p.rotation_gain == 1.0:
        mapped_orientation(p, pose[3:7], s.tool)
        return
    tool = room(4)
    mapped_orientation(p, pose[3:7], tool)
    limits.turn_from(p, s.tool, tool, turn)
    for i in range(4):
        s.tool[i] = tool[i]


@inner
def _toggle_mode(s: ScalingState, buttons: Array) -> None:
    """Change the mode at the rising edge of its button."""
    if buttons[2] > s.buttons[2]:
        s.is_fine = 1 - s.is_fine


@inner
def _toggle_fixture(s: ScalingState, buttons: Array, position: Array) -> None:
    """Put the fixture around the present position, or remove it, at the rising edge of its button."""
    if buttons[1] > s.buttons[1]:
        s.is_fixture_on = 1 - s.is_fixture_on
        for i in range(3):
            s.center[i], s.beyond[i] = position[i], 0.0


@inner
def _latch(p: ScalingRecord, s: ScalingState, stylus: Array) -> None:
    """Hold the command, and measure later motion from the present pose, so that the command never jumps.

    The fixture moves with the hand, so that it does not move relative to the slave.
    """
    if s.is_engaged:
        for i in range(3):
            s.center[i] += stylus[i] - s.stylus[i]
    limits.align(p, s)
    limits.forget_limits(s)


@inner
def _move(p: ScalingRecord, s: ScalingState, fixture: Held, gain: float, position: Array, turn: Array) -> None:
    """Add the scaled step of the hand to the command; rotate the tool like the hand, or like the aligned stylus."""
    step = room(3)
    for i in range(3):
        step[i] = position[i] - s.master[i]
    if s.is_fixture_on and p.holds_slave:
        side.hold_slave(s, fixture, step)
    else:
        side.let_go(s)
    to_slave_axes(p, step, step)
    for i in range(3):
        s.command[i] += gain * step[i]
    if p.rotation_gain == 1.0:
        limits.follow_hand(p, s)
    else:
        for i in range(3):
            turn[i] *= p.rotation_gain
        limits.turn_on(p, s.command[3:7], turn, s.command[3:7])
        limits.align(p, s)
    # One Newton step keeps the product of many unit quaternions a unit quaternion.
    square = 0.0
    for i in range(3, 7):
        square += s.command[i] * s.command[i]
    for i in range(3, 7):
        s.command[i] *= 1.5 - 0.5 * square


@inner
def _wall(p: ScalingRecord, s: ScalingState, fixture: Held, period: float, stylus: Array, force: Array) -> None:
    """Write the push (3,) [N] of the fixture's wall; after a pause the wall restarts without a previous position."""
    offset, out, length = room(3), room(3), 0.0
    for i in range(3):
        offset[i], out[i] = stylus[i] - s.center[i], 0.0
    if s.is_fixture_on and p.holds_hand:
        length = fixture_depth(fixture, offset, out)
    if p.is_damped == 0:
        walls.wall_force(out, length, p.spring, p.fixture.max_force, force)
        return
    if period <= 0.0 or period > 1e-9 * p.pause_ns:
        walls.forget_wall(s, stylus)
        period = _LONG
    walls.damped_wall(p.fixture, p.spring, s, stylus, out, length, period, force)


@inner
def _push_back(p: ScalingRecord, s: ScalingState, force: Array) -> None:
    """Add the push that the slave's limit causes to the force (3,) [N], in the master's base."""
    push = p.reach_stiffness * s.depth
    if push > 0.0:
        for i in range(3):
            force[p.axis[i]] -= p.sign[i] * push * s.out[i]


@inner
def _report(p: ScalingRecord, s: ScalingState, gain: float, is_following: bool, row: Row) -> None:
    """Write teleop_state; the fixture is given in the slave's base, where it confines the slave."""
    state = row.teleop_state
    state[_FOLLOWING] = 1.0 if is_following else 0.0
    state[_CLUTCHED], state[_FINE] = s.buttons[0], s.is_fine
    state[_GAIN], state[_FIXTURE] = gain, s.is_fixture_on
    for i in range(6):
        state[_CENTER + i] = 0.0
    if s.is_fixture_on:
        offset = room(3)
        for i in range(3):
            offset[i] = s.center[i] - s.master[i] + s.beyond[i]
        to_slave_axes(p, offset, offset)
        for i in range(3):
            # Rounded to a nanometre, so that a fixture at rest reports no change.
            state[_CENTER + i] = round((s.command[i] + gain * offset[i]) * 1e9) / 1e9
            state[_SIZE + i] = gain * p.size[p.axis[i]]
    state[_LIMIT], state[_JOINT] = s.limit, s.joint


@inner
def _refuse(
    p: ScalingRecord,
    s: ScalingState,
    sent: Sequence[limits.Sent],
    is_following: bool,
    is_doubtful: bool,
    stylus: Array,
    row: Row,
) -> None:
    """Answer an implausible sample: hold the command, write no force, and restart at the next sample."""
    s.must_latch = 1
    limits.remember(s, sent, row.master_measured_cp_ns)
    walls.forget_wall(s, stylus)
    for i in range(6):
        row.master_servo_cf[i] = 0.0
    for i in range(3):
        s.push[i], s.pushed_at[i] = 0.0, stylus[i]
    lead_by_force(p, s, row)
    if not (is_doubtful or (is_following and s.is_engaged)):
        copy(row.slave_setpoint_cp, s.command)
    copy(s.command, row.slave_servo_cp)
    s.last_ns = row.master_measured_cp_ns
    _report(p, s, p.gain[s.is_fine], is_following, row)


@kernel
def motion_scaling_step(
    p: ScalingRecord, s: ScalingState, sent: Sequence[limits.Sent], fixture: Held, law: Law, row: Row, dt: float
) -> None:
    """One master sample: write slave_servo_cp, master_servo_cf and teleop_state.

    Args:
        p: Parameter record.
        s: State record; written.
        sent: Records of :class:`~teleop_core.coupling.mapping.limits.Sent`; written.
        fixture: The fixture.
        law: :class:`~teleop_core.coupling.mapping.reflection.Law`; written.
        row: Signals.
        dt: Tick [s].

    Position is incremental (X_S += gain X_P), so a change of gain alone causes no motion. The tool turns
    about the axis about which the hand turns. With ``tool_axes`` its orientation is that of the stylus instead. An
    alignment is stored whenever the slave is engaged again. While clutched the
    command is held. While the slave does not follow, the command is the slave's own setpoint. A command out of reach
    is cut, and motion continues from there: see :mod:`teleop_core.coupling.mapping.limits`. The slave follows the
    pose, which a tremor filter may have delayed. Forces on the hand use the unfiltered stylus. A fixture that confines
    the slave shortens the steps of the command: see :mod:`teleop_core.coupling.mapping.side`.

    Source:
        Vongbunyong 2008, sections 6.2-6.3.
    """
    pose, buttons, stylus = row.master_measured_cp, row.master_buttons, room(3)
    for i in range(3):
        stylus[i] = pose[i] + row.master_filtered_out[i]
    period = 1e-9 * (row.master_measured_cp_ns - s.last_ns)
    following.hear(s, row)
    is_following = following.follows(p, s, row)
    is_doubtful = following.is_in_doubt(p, s, is_following, row)
    limits.draw_back(p, s, sent, p.gain[s.is_fine], row)
    if not plausibility.is_plausible(p.plausible, p.pause_ns, s, pose, row.master_measured_cp_ns):
        _refuse(p, s, sent, is_following, is_doubtful, stylus, row)
        return
    clutch = 1.0 if plausibility.has_lost_buttons(p.silence_ns, s, row) else buttons[0]
    _toggle_mode(s, buttons)
    gain = p.gain[s.is_fine]
    turn = room(3)
    _take_tool(p, s, pose, turn)
    to_slave_axes(p, pose, s.hand)
    if not (is_following and s.is_engaged):
        s.must_latch = 1
        if not is_doubtful:
            copy(row.slave_setpoint_cp, s.command)
    if s.must_latch and s.has_led:
        s.aligned += 1
    s.has_led = 1 - s.must_latch
    if s.must_latch or clutch > 0.0 or s.buttons[0] > 0.0:
        _latch(p, s, stylus)
    else:
        _move(p, s, fixture, gain, pose, turn)
        limits.measure_depth(p, s, p.reach_depth, row.master_measured_cp_ns)
    _toggle_fixture(s, buttons, stylus)
    s.is_engaged, s.must_latch = 1, 0
    for i in range(3):
        s.master[i], s.stylus[i], s.buttons[i] = pose[i], stylus[i], buttons[i]
    s.buttons[0] = clutch
    s.last_ns = row.master_measured_cp_ns
    limits.remember(s, sent, s.last_ns)
    _wall(p, s, fixture, period, stylus, row.master_servo_cf)
    _push_back(p, s, row.master_servo_cf)
    reflect(p, s, law, is_following, period, stylus, row)
    lead_by_force(p, s, row)
    for i in range(7):
        row.slave_servo_cp[i] = s.command[i]
    _report(p, s, gain, is_following, row)


class MotionScaling(RunningStage):
    """Stage that turns master poses into slave poses and fixture forces."""

    def __init__(self, parameters: gains.MotionScalingParameters, dt: float = DT) -> None:
        super().__init__(MOTION_SCALING, 0, dt)
        self.changes_itself = True  # a button changes the stage's mode
        self.parameters, self.state = record(ScalingRecord), record(ScalingState)
        self._sent = record_array(limits.Sent, limits.SENT)
        self._values = parameters
        self.kernel = motion_scaling_step
        self._held = Held(None, np.empty(0), np.empty(4))
        self._law = make_law(ARCHITECTURES.find("unilateral"), np.empty(0), PASSIVITIES.find("none"), np.empty(0))
        self.reset()
        self.retune(parameters)

    def reset(self) -> None:
        """Forget the latched poses: the next sample starts from the slave's setpoint."""
        s, self._told = self.state, (0, 0)
        assign(s, 0)
        assign(self._sent, 0)
        self._law.clear()
        s["is_fine"], s["joint"] = gains.MODES.index(self._values.mode), -1
        s["command"][3] = s["alignment"][0] = s["tool"][0] = s["turned"][0] = 1.0

    def retune(self, parameters: gains.MotionScalingParameters) -> None:
        """Take new parameters from the next sample on, without any motion. A new mode takes effect."""
        fill(self.parameters, parameters)
        derive(self.parameters, parameters)
        self._take_fixture(parameters.fixture)
        self._take_reflection(parameters.reflection)
        if parameters.mode != self._values.mode:
            self.state["is_fine"] = gains.MODES.index(parameters.mode)
        turned = ("tool_roll", "axes", "tool_axes")
        if any(getattr(parameters, name) != getattr(self._values, name) for name in turned):
            self.state["must_latch"] = 1  # a new alignment, so that the tool does not rotate
        self._values = parameters

    def present(self) -> gains.MotionScalingParameters:
        """Present parameters; the mode button may have changed the mode."""
        mode = gains.MODES[int(self.state["is_fine"])]
        if mode != self._values.mode:
            self._values = replace(self._values, mode=mode)
        return self._values

    def _take_fixture(self, fixture: gains.FixtureParameters) -> None:
        held, last, s = fixture.made.held, self._held, self.state
        if fixture.made != self._values.fixture.made:  # a new fixture begins at the slave's position
            s["center"] += s["beyond"]
            s["beyond"] = 0.0
        if held.distance is last.distance and len(held.numbers) == len(last.numbers):
            last.numbers[:], last.place[:] = held.numbers, held.place  # in place, so that the composed tick stays
            # valid
            return
        self._held = held
        self._compose_anew()

    def _take_reflection(self, reflection: gains.ReflectionParameters) -> None:
        part = ARCHITECTURES.find(reflection.architecture.kind)
        passivity = PASSIVITIES.find(reflection.passivity.kind)
        numbers = part.numbers(reflection.architecture.parameters)
        kept = passivity.numbers(reflection.passivity.parameters)
        law = self._law
        if (part.push_pointer, passivity.hand_pointer) == (law.push, law.hand) and (len(numbers), len(kept)) == (
            len(law.numbers),
            len(law.kept),
        ):
            law.numbers[:], law.kept[:] = numbers, kept  # in place, so that the composed tick stays valid
            return
        if part.push_pointer is not law.push:
            # a new force starts from zero
            self.state["heard"] = self.state["seen"] = self.state["push"] = 0.0
        self._law = make_law(part, numbers, passivity, kept)
        self._compose_anew()

    def _compose_anew(self) -> None:
        self.arguments = (self.parameters, self.state, self._sent, self._held, self._law)
        self._bound = None

    def fall_silent(self) -> None:
        """Report that the slave follows no hand, because no sample arrived for a long time."""
        self.signals["teleop_state"][_FOLLOWING] = 0.0

    def concerns(self) -> list[str]:
        """Texts about implausible samples, and about buttons whose messages stopped."""
        found, told = [], self._told
        count, aligned = self._told = int(self.state["implausible"]), int(self.state["aligned"])
        if count > told[0]:
            found.append(
                f"refused {count - told[0]} samples of the master that are implausible for a hand, and held the slave"
            )
        elif aligned > told[1]:
            often = f", {aligned - told[1]} times" if aligned - told[1] > 1 else ""
            found.append(
                f"aligned hand and slave again{often}, which changes the offset between them: the master "
                "paused, or the slave did not follow"
            )
        if self.state["is_lost"]:
            found.append("no messages of the buttons: holds as if the clutch were pressed")
        return found

    def described(self) -> dict[str, str]:
        """Kind and numbers of the fixture, which teleop/state reports in addition to its columns."""
        return self._values.fixture.made.described()


MOTION_SCALING = Stage(
    "motion_scaling",
    gains.MotionScalingParameters,
    reads=(
        topics.MASTER_MEASURED_CP,
        topics.MASTER_BUTTONS,
        topics.SLAVE_SETPOINT_CP,
        topics.SLAVE_REACH,
        topics.SLAVE_MEASURED_CF,
        topics.SLAVE_MEASURED_CP,
        topics.MASTER_FILTERED_OUT,
        topics.SLAVE_ENERGY,
    ),
    writes=(
        topics.SLAVE_SERVO_CP,
        topics.MASTER_SERVO_CF,
        topics.TELEOP_STATE,
        topics.MASTER_ENERGY,
        topics.SLAVE_SERVO_CF,
    ),
    late=(
        topics.SLAVE_SETPOINT_CP,
        topics.SLAVE_REACH,
        topics.SLAVE_MEASURED_CF,
        topics.SLAVE_MEASURED_CP,
        topics.SLAVE_ENERGY,
    ),
    optional=(topics.MASTER_FILTERED_OUT, topics.SLAVE_ENERGY),
    on_demand=(topics.MASTER_ENERGY, topics.SLAVE_SERVO_CF),
    trigger=topics.MASTER_MEASURED_CP,
    needs=(topics.SLAVE_SETPOINT_CP,),
    make=MotionScaling,
)
