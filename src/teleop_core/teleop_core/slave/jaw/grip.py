"""Grip: objects that the fingers hold by dry friction, above a table with pegs.

An object is a point mass. Friction of both pads changes the speed of the object towards the speed of the tip. If
friction is too small for this, the object slides (Coulomb). Sticking and sliding follow from one rule on speeds (Moreau
1988). The speed changes by the amount that sticking needs, but at most by the change that friction gives in the tick.

Two arms share the objects. The first arm's simulator moves the objects, and receives tip pose and grip force of the
second jaw. The second arm's simulator receives the positions of the objects.
"""

import math
from typing import Annotated

from teleop_core.graph import Row, copy, topics
from teleop_core.kernels import Integers, Vector3, geometry, inner, kernel
from teleop_core.kernels.room import room
from teleop_core.slave.jaw import drive, sharing
from teleop_core.slave.jaw.parameters import PEGS

WEIGHT = 9.81
"""Standard weight per mass [m/s²], along -z of the slave's base."""
SLIP = 1e-3
"""An object that slides by more than this in one grip has slipped [m]; a smaller distance is settling of the
fingers."""
_NONE = -1  # peg number of an object that is on no peg
_LOST = 1e-3  # an object lost higher than this above the table has dropped [m]
_ROUNDS = 20  # iterations for the remaining speed of an object that a peg stops
_OPEN = 1e-3  # fingers wider than the object by more than this have released it; a smaller gap is a bounce [m]
_LETS_GO = 0.01  # a setpoint above the smallest of the grip by more than this releases the object [rad]; assumed


class GripRecord(drive.DriveRecord):
    """Parameter record of the jaw."""

    objects: int  # number of objects
    place: Vector3  # initial position of the first object on the table [m]
    peg_count: int
    axes: Annotated[geometry.Array, 2 * PEGS]  # axes of the pegs, x and y of each [m]


class GripState(drive.DriveState):
    """State record of the jaw. The two hands are this jaw and the second arm's jaw."""

    tip_ns: int
    tips: Annotated[geometry.Array, 14]  # pose of each hand's tip; for the second arm, the last two poses of its tip
    held: Vector3  # middle of the second arm's object in the tip's frame when the grip began [m]
    forces: Annotated[geometry.Array, 2]  # force of each hand's fingers on its object [N]
    numbers: Annotated[Integers, 2]  # number of the object that each hand moves, or moved last
    objects: Annotated[geometry.Array, 7 * topics.JAW_OBJECTS]  # poses (7,) of all objects
    motions: Annotated[geometry.Array, 3 * topics.JAW_OBJECTS]  # [m/s]
    pegs: Annotated[Integers, topics.JAW_OBJECTS]  # peg that each object is on; _NONE without a peg
    homes: Annotated[Integers, topics.JAW_OBJECTS]  # peg where each object rested last; _NONE: it dropped
    pull: float  # force of a peg on a gripped object, across the peg [N]
    transferred: int
    dropped: int
    is_gripped: int
    tightest: float  # setpoint of the present grip [rad]
    slid: float  # sliding distance in the present grip [m]
    grips: int
    slips: int
    drops: int


@inner
def _tip_motion(
    before: geometry.Array,
    now: geometry.Array,
    pose: geometry.Array,
    turn: geometry.Array,
    motion: geometry.Array,
    dt: float,
) -> None:
    """Write a tip's rotation (4,) since its last sample, and its velocity (3,) at the object's middle."""
    back, R = room(4), room(3, 3)
    geometry.invert_quaternion(before[3:7], back)
    geometry.multiply_quaternions(now[3:7], back, turn)
    geometry.rotation_from_quaternion(turn, R)
    for i in range(3):
        place = now[i]
        for k in range(3):
            place += R[i, k] * (pose[k] - before[k])
        motion[i] = (place - pose[i]) / dt


@inner
def _most(p: GripRecord, force: float, dt: float) -> float:
    """Largest change of an object's speed by the friction of both pads in a tick [m/s]."""
    return 2.0 * p.object.friction * force * dt / p.object.mass


@inner
def _rub(
    p: GripRecord, s: GripState, motion: geometry.Array, tip: geometry.Array, force: float, cut: float, dt: float
) -> float:
    """Change an object's speed (3,) towards the speed of the fingers, within the friction of both pads.

    Where a peg stops the object, the fingers continue to slide over it at the speed ``cut`` [m/s] across the peg.
    Friction then has its largest value, opposite to the total sliding speed. So only a part of the friction acts in the
    free direction. The remaining sliding speed ``left`` solves ``left² = cut² + (apart left / (left + most))²``.

    Returns:
        The remaining speed between fingers and object [m/s]; 0 where the object sticks.
    """
    apart, most = sharing.far_from(motion, tip), _most(p, force, dt)
    share = most / apart if apart > most else 1.0
    left = (1.0 - share) * apart
    if cut > 0.0:
        left = math.hypot(cut, apart)
        for _ in range(_ROUNDS):
            left = math.hypot(cut, apart * left / (left + most))
        share = most / (left + most)
        s.pull = max(s.pull, 2.0 * p.object.friction * force * cut / left)
    for i in range(3):
        motion[i] += share * (tip[i] - motion[i])
    return left


@inner
def _is_opened(s: GripState) -> bool:
    """Whether the hand opens the jaw; if so, an object that slides or falls counts as released, not as lost."""
    return s.setpoint > s.tightest + _LETS_GO


@inner
def _count(p: GripRecord, s: GripState, table: float, is_lost: bool) -> None:
    """Begin or end a grip, and count it; a grip ends when the fingers are wider than the object, or lose the object."""
    if s.force > 0.0 and s.is_gripped == 0:
        s.is_gripped, s.slid, s.tightest = 1, 0.0, s.setpoint
        s.grips += 1
    elif s.is_gripped and (is_lost or drive.width(p, s.angle) > p.object.size + _OPEN):
        s.is_gripped = 0
        height = s.objects[7 * s.numbers[0] + 2] - table
        if is_lost and not _is_opened(s) and height > _LOST:
            s.drops += 1
    s.tightest = min(s.tightest, s.setpoint)


@inner
def _slide(s: GripState, way: float) -> None:
    """Record a distance [m] that the object slid between the fingers."""
    before = s.slid
    s.slid += way
    if before <= SLIP < s.slid and not _is_opened(s):
        s.slips += 1


@inner
def _is_near(p: GripRecord, s: GripState, number: int, tip: geometry.Array) -> bool:
    """Whether an object's middle is no farther from a tip than half of its size."""
    square = 0.0
    for k in range(3):
        square += (s.objects[7 * number + k] - tip[k]) ** 2
    return square <= 0.25 * p.object.size * p.object.size


@inner
def _find(p: GripRecord, s: GripState, tip: geometry.Array) -> bool:
    """Return whether the object has just left the fingers; write whether the object is between the fingers.

    The object comes between the fingers only while their opening is wider than the object. It stays between them as
    long as it is near the tip.
    """
    is_near = _is_near(p, s, s.numbers[0], tip)
    is_lost = bool(s.is_between > 0 and not is_near)
    if is_lost:
        s.is_between = 0
    elif is_near and drive.width(p, s.angle) >= p.object.size:
        s.is_between = 1
    return is_lost


@inner
def _meet_peg(
    p: GripRecord, peg: int, pose: geometry.Array, motion: geometry.Array, wanted: geometry.Array, dt: float
) -> float:
    """Limit the motion (3,) of an object by the peg that the object is on.

    The peg is rigid and without friction, and its impacts are inelastic. It constrains the object only across the peg's
    axis: the distance of the object's middle from the axis is at most the clearance.

    Returns:
        The speed by which the peg slows the motion [m/s]; 0 without a peg or without contact.
    """
    if peg == _NONE:
        return 0.0
    x = pose[0] + wanted[0] * dt - p.axes[2 * peg]
    y = pose[1] + wanted[1] * dt - p.axes[2 * peg + 1]
    far = math.hypot(x, y)
    if far <= p.pegs.clearance:
        return 0.0
    x, y, cut = x / far, y / far, (far - p.pegs.clearance) / dt
    wanted[0] -= cut * x
    wanted[1] -= cut * y
    across = (wanted[0] - motion[0]) * x + (wanted[1] - motion[1]) * y
    motion[0] += across * x
    motion[1] += across * y
    return cut


@inner
def _peg_at(p: GripRecord, x: float, y: float) -> int:
    """Number of the peg whose axis is within the clearance of a point; _NONE if there is no such peg."""
    for k in range(p.peg_count):
        if math.hypot(x - p.axes[2 * k], y - p.axes[2 * k + 1]) <= p.pegs.clearance:
            return k
    return _NONE


@inner
def _thread(p: GripRecord, s: GripState, number: int, before: float, is_held: bool) -> None:
    """Put an object onto a peg or off a peg when it passes the top of the peg, and count where the object rests.

    A straight step along the tangent may exceed the clearance; the object is then moved back to the clearance.

    Args:
        p: Parameters.
        s: State; written.
        number: Number of the object.
        before: Height of the object before this tick [m].
        is_held: Whether fingers press on the object.
    """
    pose, top, peg = s.objects[7 * number : 7 * number + 7], p.place[2] + p.pegs.height, _NONE
    if pose[2] < top:
        peg = _peg_at(p, pose[0], pose[1]) if before >= top else int(s.pegs[number])
    if peg != _NONE and before < top:
        x, y = pose[0] - p.axes[2 * peg], pose[1] - p.axes[2 * peg + 1]
        far = math.hypot(x, y)
        if far > p.pegs.clearance:
            pose[0] = p.axes[2 * peg] + x / far * p.pegs.clearance
            pose[1] = p.axes[2 * peg + 1] + y / far * p.pegs.clearance
    s.pegs[number] = peg
    rests = pose[2] <= p.place[2] and not is_held
    if p.peg_count and rests and peg != s.homes[number]:
        s.homes[number] = peg
        if peg == _NONE:
            s.dropped += 1
        else:
            s.transferred += 1


@inner
def _choose(p: GripRecord, s: GripState, hand: int, tip: geometry.Array) -> None:
    """Let an empty hand select the object that its tip has reached."""
    for i in range(p.objects):
        if i != s.numbers[hand] and _is_near(p, s, i, tip):
            s.numbers[hand] = i
            return


@inner
def tell_board(p: GripRecord, s: GripState, board: geometry.Array) -> None:
    """Write counts, the peg's pull and the objects' middles into ``board``, in the order of slave/jaw/board."""
    board[0], board[1], board[2] = s.transferred, s.dropped, s.pull
    for i in range(p.objects):
        for k in range(3):
            board[3 + 3 * i + k] = s.objects[7 * i + k]


@kernel
def put_objects(p: GripRecord, s: GripState, places: geometry.Array) -> None:
    """Put all objects upright at their initial positions.

    Args:
        p: Parameters.
        s: State; written.
        places: Middles of the objects (N, 3) [m].
    """
    for i in range(len(places)):
        pose = s.objects[7 * i : 7 * i + 7]
        copy(places[i], pose[:3])
        pose[3] = 1.0
        s.pegs[i] = s.homes[i] = _peg_at(p, pose[0], pose[1])


@inner
def _hold(p: GripRecord, s: GripState, tips: geometry.Array, number: int, hands: int, dt: float) -> None:
    """Change an object's speed by the friction of the fingers; an object that sticks to the fingers rotates with them.

    Args:
        p: Parameters.
        s: State; written.
        tips: Present poses of both tips (2, 7).
        number: Number of the object.
        hands: Jaws that hold the object: 1 this jaw, 2 the second arm's jaw, 3 both jaws.
        dt: Tick [s].
    """
    pose, motion = s.objects[7 * number : 7 * number + 7], s.motions[3 * number : 3 * number + 3]
    first = 1 if hands == 2 else 0
    tip, second, turn, turned = room(3), room(3), room(4), room(4)
    if hands == 3:
        _tip_motion(s.tips[7:14], tips[1], pose, turn, second, dt)
    _tip_motion(s.tips[7 * first : 7 * first + 7], tips[first], pose, turn, tip, dt)
    if hands == 3:
        most, against = _most(p, s.forces[0], dt), _most(p, s.forces[1], dt)
        sharing.share_speed(motion, tip, most, second, against)
        left = sharing.far_from(motion, tip)
        is_stuck = left == 0.0
        copy(motion, second)
        _meet_peg(p, int(s.pegs[number]), pose, motion, second, dt)
    else:
        cut = _meet_peg(p, int(s.pegs[number]), pose, motion, tip, dt)
        left = _rub(p, s, motion, tip, s.forces[first], cut, dt)
        is_stuck = left == 0.0
    if first == 0:
        _slide(s, left * dt)
    if is_stuck:
        geometry.multiply_quaternions(turn, pose[3:7], turned)
        copy(turned, pose[3:7])


@inner
def _move(p: GripRecord, s: GripState, tips: geometry.Array, number: int, dt: float) -> None:
    """Advance an object by a tick under the forces of fingers, weight, table and peg."""
    pose, motion = s.objects[7 * number : 7 * number + 7], s.motions[3 * number : 3 * number + 3]
    hands = 0
    for hand in range(2):
        if s.forces[hand] > 0.0 and s.numbers[hand] == number:
            hands += hand + 1
    motion[2] -= WEIGHT * dt
    is_on_table = pose[2] <= p.place[2]
    if is_on_table:
        motion[2] = max(motion[2], 0.0)
    if hands:
        _hold(p, s, tips, number, hands, dt)
    elif is_on_table:
        motion[0] = motion[1] = 0.0
    else:
        wanted = room(3)
        copy(motion, wanted)
        _meet_peg(p, int(s.pegs[number]), pose, motion, wanted, dt)
    before = pose[2]
    for i in range(3):
        pose[i] += motion[i] * dt
    if pose[2] < p.place[2]:
        pose[2], motion[2] = p.place[2], 0.0
    _thread(p, s, number, before, hands > 0)


@inner
def _take_hands(p: GripRecord, s: GripState, tips: geometry.Array, row: Row) -> None:
    """Read both tip poses (2, 7), the forces of both jaws, and the numbers of the objects that they press on."""
    copy(row.slave_true_cp, tips[0])
    copy(row.second_slave_true_cp, tips[1])
    for i in range(3):
        tips[1, i] += p.second_base[i]
    at = 7 * s.numbers[0]
    rests = s.objects[at + 2] <= p.place[2] or row.second_slave_true_cp_ns > 0
    if not (s.is_between or s.is_gripped) and rests:
        _choose(p, s, 0, tips[0])
    if s.forces[1] == 0.0:
        _choose(p, s, 1, tips[1])
    s.forces[0] = s.force
    is_there = _is_near(p, s, int(s.numbers[1]), tips[1])
    s.forces[1] = row.second_slave_jaw_grip[0] if is_there else 0.0


@inner
def move_objects(p: GripRecord, s: GripState, row: Row) -> None:
    """Advance the objects to the stamp of the newest slave_true_cp.

    Args:
        p: Parameters.
        s: State, with the force of the fingers; written.
        row: Signals.
    """
    elapsed_ns = row.slave_true_cp_ns - s.tip_ns
    if elapsed_ns <= 0:  # no tip pose is known yet, or no newer one
        return
    tips = room(2, 7)
    _take_hands(p, s, tips, row)
    s.tip_ns, dt = row.slave_true_cp_ns, 1e-9 * elapsed_ns
    s.pull = 0.0
    for i in range(p.objects):
        _move(p, s, tips, i, dt)
    copy(tips[0], s.tips[0:7])
    copy(tips[1], s.tips[7:14])
    _count(p, s, p.place[2], _find(p, s, tips[0]))


@inner
def see_objects(p: GripRecord, s: GripState, row: Row) -> None:
    """Read the object positions from the first arm's simulator, and count the grips of this jaw.

    Args:
        p: Parameters.
        s: State, with the force of the fingers; written.
        row: Signals.
    """
    board, n = row.first_slave_jaw_board, s.numbers[0]
    s.transferred, s.dropped, s.pull = int(board[0]), int(board[1]), board[2]
    for i in range(p.objects):
        for k in range(3):
            s.objects[7 * i + k] = board[3 + 3 * i + k] - p.second_base[k]
    # The board is one tick old, and its objects follow the tip pose of the tick before.
    R, way = room(3, 3), room(3)
    geometry.rotation_from_quaternion(s.tips[10:14], R)
    for i in range(3):
        way[i] = 0.0
        for k in range(3):
            way[i] += R[k, i] * (s.objects[7 * n + k] - s.tips[7 + k])
    copy(s.tips[0:7], s.tips[7:14])
    copy(row.slave_true_cp, s.tips[0:7])
    if s.is_gripped:
        _slide(s, max(sharing.far_from(way, s.held) - s.slid, 0.0))
    else:
        copy(way, s.held)
        _choose(p, s, 0, s.tips[0:7])
    _count(p, s, p.place[2] - p.second_base[2], _find(p, s, s.tips[0:7]))
