"""Stage ``jaw``: the jaw's server. It writes the setpoint that simulated drives or a real gripper follow.

The stage moves the jaw's setpoint as ``slave`` moves the arm's setpoint. It receives the jaw's measured angle.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, fill, fixed, parameter
from teleop_core.graph import DT, Row, RunningStage, Stage, assign, topics
from teleop_core.graph.operation import State
from teleop_core.kernels import Fields, inner, kernel, record

_STATE, _ENABLED = topics.OPERATION.index("state"), int(State.ENABLED)
_NEAR = 1e-3  # a command this near to the held angle has reached it [rad]
_MOVED = 0.05  # if its distance from the setpoint grew by more, something else moved the jaw [rad]
_CLOSING = 0.02  # a command that decreases by this much closes the jaw; the angle of a resting hand varies less [rad]


@dataclass(frozen=True, kw_only=True)
class JawParameters:
    """Parameters of :class:`Jaw`."""

    command_timeout: float = parameter(
        0.1,
        Within(0.002, 5.0, "s"),
        "if no command or no measured angle of the jaw arrives for this time, the jaw holds its setpoint",
    )
    upper: float = fixed(0.8, Within(0.05, 3.0, "rad"), "largest commanded angle between the fingers", source="assumed")
    speed_limit: float = parameter(
        4.0, Within(0.01, 100.0, "rad/s"), "largest speed of the jaw's setpoint", source="assumed"
    )


class JawRecord(JawParameters, Fields):
    """Parameter record of the jaw's server."""

    timeout_ns: int


class JawState(Fields):
    """State record of the jaw's server."""

    told_ns: int  # stamp of the newest command
    heard_ns: int  # time of arrival of the newest command [ns]
    sampled_ns: int  # stamp of the newest slave/jaw/measured_js
    seen_ns: int  # time of arrival of the newest measured angle [ns]
    off: float  # distance of the jaw from its setpoint at that time [rad]
    setpoint: float  # [rad]
    is_led: int  # whether the jaw has followed commands since it was last held
    lowest: float  # smallest command since the jaw was last held [rad]
    highest: float  # [rad]


@inner
def _see(p: JawRecord, s: JawState, row: Row) -> None:
    """Take the jaw's measured angle.

    Until the first command is followed, the setpoint equals this angle. The setpoint is also set to this angle if no
    angle was measured for a while and the jaw is now farther from its setpoint than before: then something else moved
    the jaw.
    """
    angle = row.slave_jaw_measured_js[0]
    if row.slave_jaw_measured_js_ns == s.sampled_ns or not math.isfinite(angle):
        return
    was_silent = row.now_ns - s.seen_ns > p.timeout_ns
    is_elsewhere = was_silent and abs(angle - s.setpoint) > s.off + _MOVED
    if row.slave_jaw_setpoint_js_ns == topics.NO_COMMAND_NS or is_elsewhere:
        s.setpoint = min(max(angle, 0.0), p.upper)
    s.off = abs(angle - s.setpoint)
    s.sampled_ns, s.seen_ns = row.slave_jaw_measured_js_ns, row.now_ns


@inner
def _may_move(p: JawRecord, s: JawState, row: Row) -> bool:
    """Whether the arm may move and both commands and measured angles arrive."""
    if row.slave_jaw_servo_jp_ns != s.told_ns:
        s.told_ns, s.heard_ns = row.slave_jaw_servo_jp_ns, row.now_ns
    is_heard = s.told_ns != 0 and row.now_ns - s.heard_ns <= p.timeout_ns
    is_seen = s.sampled_ns != 0 and row.now_ns - s.seen_ns <= p.timeout_ns
    is_sound = math.isfinite(row.slave_jaw_servo_jp[0])
    return bool(is_heard and is_seen and is_sound and row.slave_operation[_STATE] == _ENABLED)


@inner
def _is_led(s: JawState, wanted: float) -> bool:
    """Whether the jaw follows its command; after a hold the operator must take control again.

    The command can open the jaw only after some command since the hold was at the held angle or below. So no object
    falls because the hand was opened during a stop. The command can close the jaw after some command was at the held
    angle or above, or while the commands are closing.
    """
    if s.is_led == 0:
        s.lowest, s.highest = min(s.lowest, wanted), max(s.highest, wanted)
        if wanted > s.setpoint:
            s.is_led = 1 if s.lowest <= s.setpoint + _NEAR else 0
        else:
            s.is_led = 1 if s.highest >= min(s.setpoint - _NEAR, wanted + _CLOSING) else 0
    return s.is_led > 0


@kernel
def jaw_step(p: JawRecord, s: JawState, row: Row, dt: float) -> None:
    """One tick: move the setpoint towards the command, if the jaw may move.

    Args:
        p: Parameter record.
        s: State record; written.
        row: Signals.
        dt: Tick [s].
    """
    _see(p, s, row)
    if not _may_move(p, s, row):
        s.is_led, s.lowest, s.highest = 0, math.inf, -math.inf
    else:
        # Below 0 the fingers press on each other, or press a thin object harder.
        wanted, most = min(max(row.slave_jaw_servo_jp[0], -p.upper), p.upper), p.speed_limit * dt
        if _is_led(s, wanted):
            s.setpoint += min(max(wanted - s.setpoint, -most), most)
            row.slave_jaw_setpoint_js_ns = row.slave_jaw_servo_jp_ns
    row.slave_jaw_setpoint_js[0] = s.setpoint


class Jaw(RunningStage):
    """Stage of the jaw's server; the setpoint begins at the measured angle of the jaw."""

    def __init__(self, parameters: JawParameters, dt: float = DT) -> None:
        super().__init__(JAW_STAGE, 0, dt)
        self.parameters, self.state = record(JawRecord), record(JawState)
        self.kernel, self.arguments = jaw_step, (self.parameters, self.state)
        self._begin = self.signals.copy()
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first tick, without any command."""
        s, row = self.state, self.signals
        assign(s, 0)
        assign(row, self._begin)
        s["setpoint"] = row["slave_jaw_setpoint_js"] = self.parameters.upper
        s["lowest"], s["highest"] = math.inf, -math.inf
        row["slave_jaw_setpoint_js_ns"] = topics.NO_COMMAND_NS

    def retune(self, parameters: JawParameters) -> None:
        """Take new parameters from the next tick on; the setpoint stays."""
        fill(self.parameters, parameters)
        self.parameters.timeout_ns = round(parameters.command_timeout * 1e9)

    def concerns(self) -> list[str]:
        """Report a command that has not yet reached the held angle."""
        s = self.state
        if s["is_led"] or s["lowest"] > s["highest"]:
            return []
        asked, held = float(self.signals["slave_jaw_servo_jp"][0]), float(s["setpoint"])
        way = "close the hand first" if asked > held else "open the hand first, or close it"
        return [f"the jaw holds at {held:.3f} rad, the command is {asked:.3f} rad: {way}"]


JAW_STAGE = Stage(
    "jaw",
    JawParameters,
    reads=(topics.SLAVE_JAW_SERVO_JP, topics.SLAVE_OPERATION, topics.SLAVE_JAW_MEASURED_JS),
    writes=(topics.SLAVE_JAW_SETPOINT_JS,),
    late=(topics.SLAVE_JAW_MEASURED_JS,),
    optional=(topics.SLAVE_JAW_SERVO_JP,),
    make=Jaw,
)
