"""Limits: a command that the arm cannot follow is drawn back, without wind-up.

The command is drawn back to a pose that the arm can reach, so that it moves immediately when the hand reverses. The
depth of the hand beyond the limit is measured from the point at which the hand met the limit. When the depth exceeds a
bound, this point moves with the hand. The hand feels the depth, and the state reports it.
"""

import math
from collections.abc import Sequence

from teleop_core.graph import Row, topics
from teleop_core.kernels import Fields, PoseRow, Quaternion, Vector3, geometry, inner
from teleop_core.kernels.room import room

SENT = 8192
"""Number of commands that are stored until the slave reports how far it could follow them."""


class Sent(Fields):
    """Sum of the cuts of all commands before a sent command."""

    stamp_ns: int
    moved: Vector3
    turned: Quaternion


class TurnRecord(Fields):
    """Fields of a parameter record with the frame in which the tool repeats the hand's turns."""

    has_tool_axes: int  # 1: the tool's own frame, as the stylus turns in its own; 0: the slave's base


class LimitState(Fields):
    """Fields of a state record with the limit that hand and slave meet.

    Positions [m] are in the slave's axes, rotations [rad] in the frame of :class:`TurnRecord`. The hand is beyond the
    limit while a depth is positive.
    """

    command: PoseRow
    hand: Vector3  # position to which the hand moves the slave [m]
    tool: Quaternion  # tool orientation that the hand commands
    alignment: Quaternion
    moved: Vector3  # sum of all cuts of commands so far
    turned: Quaternion
    answered_ns: int  # index of the command that was answered last
    sent: int  # number of sent commands
    limit: int
    joint: int
    until_ns: int
    anchor: Vector3  # position at which the hand reached the limit
    out: Vector3  # outward direction
    depth: float  # distance beyond the limit
    turn_anchor: Quaternion
    turn_out: Vector3
    turn_depth: float
    met: float  # depth at the last cut; a hand with a larger depth has left the limit
    turn_met: float


_LIMIT, _JOINT, _CUT = (topics.SLAVE_REACH.columns.index(name) for name in ("limit", "joint", "cut_x"))
_NONE, _AT_JOINT, _BEYOND = int(topics.Limit.NONE), int(topics.Limit.JOINT), int(topics.Limit.WORKSPACE)
# A limit is reported for this long after the last command that met it [ns].
_TOLD_NS = 100_000_000
# Largest rotation beyond a limit that is measured [rad].
_MOST_TURN = 0.05
# The hand has left the limit when its depth exceeds the depth at the last cut by more than these tolerances.
_PAST = 2e-4  # tolerance of position [m]
_TURN_PAST = 5e-3  # tolerance of rotation [rad]
# A cut smaller than this is rounding [m or rad].
_ROUNDING = 1e-9


@inner
def forget_limits(s: LimitState) -> None:
    """Forget all limits, for example when the hand disengages from the slave."""
    s.limit, s.joint, s.until_ns = _NONE, -1, 0
    s.depth = s.turn_depth = 0.0


@inner
def remember(s: LimitState, sent: Sequence[Sent], stamp_ns: int) -> None:
    """Store the sum of the cuts of the command that is sent now."""
    entry = sent[s.sent % len(sent)]
    entry.stamp_ns = stamp_ns
    for i in range(3):
        entry.moved[i] = s.moved[i]
    for i in range(4):
        entry.turned[i] = s.turned[i]
    s.sent += 1


@inner
def _found(s: LimitState, sent: Sequence[Sent], stamp_ns: int) -> int:
    """Index of the command with a stamp; -1 if the command is too old to be stored."""
    count = len(sent)
    for back in range(1, min(count, s.sent) + 1):
        at = (s.sent - back) % count
        if sent[at].stamp_ns <= stamp_ns:
            return at if sent[at].stamp_ns == stamp_ns else -1
    return -1


@inner
def draw_back(p: TurnRecord, s: LimitState, sent: Sequence[Sent], gain: float, row: Row) -> None:
    """Take the answer to an earlier command: draw the present command back by the cut of the earlier command.

    Cuts that were made since the earlier command was sent are not made again.

    Args:
        p: Parameters.
        s: State record with ``command`` (7,), ``hand`` (3,) [m] in the slave's axes and ``tool``
            (4,), the orientation that the hand asks for before alignment, of the last sample, and
            :data:`LIMIT_FIELDS`; written.
        sent: Records of :data:`SENT_FIELDS`.
        gain: Slave motion per hand motion.
        row: Signals with ``slave_reach``.
    """
    reach, stamp_ns = row.slave_reach, row.slave_reach_ns
    if stamp_ns in (0, s.answered_ns):
        return
    s.answered_ns = stamp_ns
    limit = int(reach[_LIMIT])
    if limit == _NONE:
        return
    if s.limit == _NONE:
        s.limit, s.joint = limit, int(reach[_JOINT])
    s.until_ns = row.master_measured_cp_ns + _TOLD_NS
    at = _found(s, sent, stamp_ns) if limit in (_AT_JOINT, _BEYOND) else -1
    if at >= 0:
        _move_back(s, sent[at], gain, reach)
        _turn_back(p, s, sent[at], reach)


@inner
def _move_back(s: LimitState, entry: Sent, gain: float, reach: geometry.Array) -> None:
    cut, square = room(3), 0.0
    for i in range(3):
        cut[i] = entry.moved[i] + reach[_CUT + i] - s.moved[i]
        square += cut[i] * cut[i]
    length = math.sqrt(square)
    if length <= _ROUNDING:
        return
    if s.depth <= 0.0:
        s.depth = length / gain
    s.met = s.depth
    for i in range(3):
        s.command[i] += cut[i]
        s.moved[i] += cut[i]
        s.out[i] = -cut[i] / length
        s.anchor[i] = s.hand[i] - s.depth * s.out[i]


@inner
def _turn_back(p: TurnRecord, s: LimitState, entry: Sent, reach: geometry.Array) -> None:
    wanted, cut = room(4), room(3)
    for i in range(4):
        wanted[i] = entry.turned[i]
    geometry.turn_by(reach[_CUT + 3 : _CUT + 6], wanted)
    geometry.turn_between(s.turned, wanted, cut)
    length = math.sqrt(cut[0] * cut[0] + cut[1] * cut[1] + cut[2] * cut[2])
    if length <= _ROUNDING:
        return
    if s.turn_depth <= 0.0:
        s.turn_depth = min(length, _MOST_TURN)
    s.turn_met = s.turn_depth
    before = room(4)
    for i in range(4):
        before[i], s.turned[i] = s.command[3 + i], wanted[i]
    geometry.turn_by(cut, s.command[3:7])
    align(p, s)
    turn_from(p, before, s.command[3:7], cut)
    for i in range(3):
        s.turn_out[i] = -cut[i] / length
    _anchor_turn(p, s)


@inner
def align(p: TurnRecord, s: LimitState) -> None:
    """Align: from now on the hand's present orientation corresponds to the orientation of the command."""
    inverse = room(4)
    geometry.invert_quaternion(s.tool, inverse)
    if p.has_tool_axes:
        geometry.multiply_quaternions(s.command[3:7], inverse, s.alignment)
    else:
        geometry.multiply_quaternions(inverse, s.command[3:7], s.alignment)


@inner
def follow_hand(p: TurnRecord, s: LimitState) -> None:
    """Turn the command as the hand has turned since the alignment."""
    if p.has_tool_axes:
        geometry.multiply_quaternions(s.alignment, s.tool, s.command[3:7])
    else:
        geometry.multiply_quaternions(s.tool, s.alignment, s.command[3:7])


@inner
def turn_from(p: TurnRecord, a: geometry.Array, b: geometry.Array, vector: geometry.Array) -> None:
    """Write the rotation vector (3,) [rad] from quaternion ``a`` to ``b``."""
    if p.has_tool_axes:
        geometry.turn_within(a, b, vector)
    else:
        geometry.turn_between(a, b, vector)


@inner
def turn_on(p: TurnRecord, start: geometry.Array, vector: geometry.Array, end: geometry.Array) -> None:
    """Write the quaternion ``start``, rotated by a vector (3,) [rad], into ``end``."""
    if p.has_tool_axes:
        geometry.rotate_by_vector(start, vector[0], vector[1], vector[2], end)
        return
    turned = room(4)
    for i in range(4):
        turned[i] = start[i]
    geometry.turn_by(vector, turned)
    for i in range(4):
        end[i] = turned[i]


@inner
def _anchor_turn(p: TurnRecord, s: LimitState) -> None:
    """Set the anchor to the hand's orientation, rotated back by the depth."""
    back = room(3)
    for i in range(3):
        back[i] = -s.turn_depth * s.turn_out[i]
    turn_on(p, s.tool, back, s.turn_anchor)


@inner
def measure_depth(p: TurnRecord, s: LimitState, most: float, now_ns: int) -> None:
    """Measure how far the hand is now beyond the limit; a hand that has left the limit reports none.

    Args:
        p: Parameters.
        s: State record.
        most: Depth [m] beyond which the anchor moves with the hand.
        now_ns: Time [ns].
    """
    if s.depth > 0.0:
        s.depth = 0.0
        for i in range(3):
            s.depth += (s.hand[i] - s.anchor[i]) * s.out[i]
        if s.depth > s.met + _PAST:
            s.depth = 0.0
        if s.depth > most:
            s.depth = most
            for i in range(3):
                s.anchor[i] = s.hand[i] - most * s.out[i]
    if s.turn_depth > 0.0:
        turn = room(3)
        turn_from(p, s.turn_anchor, s.tool, turn)
        s.turn_depth = turn[0] * s.turn_out[0] + turn[1] * s.turn_out[1] + turn[2] * s.turn_out[2]
        if s.turn_depth > s.turn_met + _TURN_PAST:
            s.turn_depth = 0.0
        if s.turn_depth > _MOST_TURN:
            s.turn_depth = _MOST_TURN
            _anchor_turn(p, s)
    if s.depth <= 0.0 and s.turn_depth <= 0.0 and now_ns > s.until_ns:
        s.limit, s.joint = _NONE, -1
