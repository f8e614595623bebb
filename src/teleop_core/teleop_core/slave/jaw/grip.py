"""Grip: objects that the fingers hold by dry friction, one at a time, over a table with pegs.

The object is one mass. Friction of both pads brings it to the motion of the tip as far as it can;
what is missing, it slides (Coulomb). Time-stepping in speeds makes both one rule, after Moreau
1988: the change of speed that sticking needs, or the largest that friction gives in the tick.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from teleop_core.graph.row import Row
from teleop_core.graph.signals import copy
from teleop_core.graph.topics import JAW_OBJECTS
from teleop_core.kernels import geometry, inner, kernel
from teleop_core.kernels.fields import Integers, PoseRow, Vector3
from teleop_core.slave.jaw.drive import DriveNumbers, DriveState, width

WEIGHT = 9.81
"""Standard weight per mass [m/s²], along -z of the slave's base."""
SLIP = 1e-3
"""What slides by more in one grip has slipped [m]; less is the settling of the fingers."""
PEGS = 12
"""Most pegs of a board."""
_NONE = -1  # peg of an object that is on none
_LOST = 1e-3  # so far above the table an object that is lost has dropped [m]
_ROUNDS = 20  # of the equation for the speed that is left where a peg stops the object
_OPEN = 1e-3  # fingers that are so much wider than the object have let go, others bounce [m]
_LETS_GO = 0.01  # a setpoint so much wider than the grip's tightest opens the jaw [rad], assumed


class GripNumbers(DriveNumbers):
    """Parameter record of the jaw."""

    objects: int  # how many there are
    place: Vector3  # of the first object at first, where it stands on the table [m]
    pegs: int  # how many there are
    axes: Annotated[geometry.Array, 2 * PEGS]  # of the pegs, x and y of each [m]
    peg_height: float  # [m]
    clearance: float  # of a peg in an object, on each side [m]
    mass: float  # [kg]
    pad_friction: float


class GripState(DriveState):
    """State record of the jaw."""

    tip_ns: int
    tip: PoseRow
    object: PoseRow  # the one that moves, or moved last
    number: int  # of that object
    objects: Annotated[
        geometry.Array, 7 * JAW_OBJECTS
    ]  # poses of all, of the moving one an old one
    motion: Vector3  # of the object [m/s]
    peg: int  # the object is on it; _NONE without
    pull: float  # of the peg on the object, across [N]
    homes: Annotated[Integers, JAW_OBJECTS]  # peg where each rested last; _NONE: it dropped
    transferred: int
    dropped: int
    is_gripped: int
    tightest: float  # setpoint of the present grip [rad]
    slid: float  # in the present grip [m]
    grips: int
    slips: int
    drops: int


class GripRoom(NamedTuple):
    """Room to work in."""

    back: geometry.Array  # (4,)
    turn: geometry.Array  # (4,)
    turned: geometry.Array  # (4,)
    R: geometry.Array  # (3, 3)
    motion: geometry.Array  # (3,)


def make_room() -> GripRoom:
    """Room for :func:`move_object`."""
    return GripRoom(np.empty(4), np.empty(4), np.empty(4), np.empty((3, 3)), np.empty(3))


@inner
def _tip_motion(s: GripState, room: GripRoom, tip: geometry.Array, dt: float) -> None:
    """Write the tip's turn since its last sample, and its speed (3,) at the object's middle."""
    geometry.invert_quaternion(s.tip[3:7], room.back)
    geometry.multiply_quaternions(tip[3:7], room.back, room.turn)
    geometry.rotation_from_quaternion(room.turn, room.R)
    for i in range(3):
        place = tip[i]
        for k in range(3):
            place += room.R[i, k] * (s.object[k] - s.tip[k])
        room.motion[i] = (place - s.object[i]) / dt


@inner
def _rub(p: GripNumbers, s: GripState, room: GripRoom, cut: float, dt: float) -> float:
    """Bring the object's speed (3,) to that of the fingers, as far as friction of both can.

    Where a peg stops the object, the fingers slide on by ``cut`` [m/s] across it, and friction has
    its largest value, against the whole way of sliding: what is left for the way that is free is
    less. The speed that is left solves ``left² = cut² + (apart left / (left + most))²``.

    Returns:
        The speed that is left between them [m/s]; 0 where it sticks.
    """
    square = 0.0
    for i in range(3):
        square += (s.motion[i] - room.motion[i]) ** 2
    apart = math.sqrt(square)
    most = 2.0 * p.pad_friction * s.force * dt / p.mass
    share = most / apart if apart > most else 1.0
    left = (1.0 - share) * apart
    if cut > 0.0:
        left = math.hypot(cut, apart)
        for _ in range(_ROUNDS):
            left = math.hypot(cut, apart * left / (left + most))
        share = most / (left + most)
        s.pull = 2.0 * p.pad_friction * s.force * cut / left
    for i in range(3):
        s.motion[i] += share * (room.motion[i] - s.motion[i])
    return left


@inner
def _is_opened(s: GripState) -> bool:
    """Whether the hand opens the jaw: what slides or falls then is let go, not lost."""
    return s.setpoint > s.tightest + _LETS_GO


@inner
def _count(p: GripNumbers, s: GripState, is_lost: bool) -> None:
    """Begin and end a grip; it ends where the fingers are wider than the object, or it is lost."""
    if s.force > 0.0 and s.is_gripped == 0:
        s.is_gripped, s.slid, s.tightest = 1, 0.0, s.setpoint
        s.grips += 1
    elif s.is_gripped and (is_lost or width(p, s.angle) > p.size + _OPEN):
        s.is_gripped = 0
        if is_lost and not _is_opened(s) and s.object[2] - p.place[2] > _LOST:
            s.drops += 1
    s.tightest = min(s.tightest, s.setpoint)


@inner
def _slide(s: GripState, way: float) -> None:
    """Take note of a way [m] that the object slid between the fingers."""
    before = s.slid
    s.slid += way
    if before <= SLIP < s.slid and not _is_opened(s):
        s.slips += 1


@inner
def _find(p: GripNumbers, s: GripState, tip: geometry.Array) -> bool:
    """Whether the object has just left the fingers; says whether it is between them.

    It comes between them where they are wider than it, and stays as long as its middle is no
    farther from the tip than half of its size.
    """
    square = 0.0
    for i in range(3):
        square += (s.object[i] - tip[i]) ** 2
    is_near = square <= 0.25 * p.size * p.size
    is_lost = bool(s.is_between > 0 and not is_near)
    if is_lost:
        s.is_between = 0
    elif is_near and width(p, s.angle) >= p.size:
        s.is_between = 1
    return is_lost


@inner
def _meet_peg(p: GripNumbers, s: GripState, room: GripRoom, dt: float) -> float:
    """Stop a motion in ``room`` where the peg is that the object is on, and the object with it.

    The peg is rigid, has no friction, and gives nothing back. It holds the object across its axis
    alone, no farther away from it than the clearance.

    Returns:
        The speed that it takes from the motion [m/s]; 0 without a peg or a touch.
    """
    s.pull = 0.0
    if s.peg == _NONE:
        return 0.0
    x = s.object[0] + room.motion[0] * dt - p.axes[2 * s.peg]
    y = s.object[1] + room.motion[1] * dt - p.axes[2 * s.peg + 1]
    far = math.hypot(x, y)
    if far <= p.clearance:
        return 0.0
    x, y, cut = x / far, y / far, (far - p.clearance) / dt
    room.motion[0] -= cut * x
    room.motion[1] -= cut * y
    across = (room.motion[0] - s.motion[0]) * x + (room.motion[1] - s.motion[1]) * y
    s.motion[0] += across * x
    s.motion[1] += across * y
    return cut


@inner
def _peg_at(p: GripNumbers, x: float, y: float) -> int:
    """Number of the peg whose axis is within the clearance of a place; _NONE without."""
    for k in range(p.pegs):
        if math.hypot(x - p.axes[2 * k], y - p.axes[2 * k + 1]) <= p.clearance:
            return k
    return _NONE


@inner
def _keep_on(p: GripNumbers, s: GripState) -> None:
    """Bring the object back by what a tick along the peg's tangent took it off the clearance."""
    x, y = s.object[0] - p.axes[2 * s.peg], s.object[1] - p.axes[2 * s.peg + 1]
    far = math.hypot(x, y)
    if far > p.clearance:
        s.object[0] = p.axes[2 * s.peg] + x / far * p.clearance
        s.object[1] = p.axes[2 * s.peg + 1] + y / far * p.clearance


@inner
def _thread(p: GripNumbers, s: GripState, before: float) -> None:
    """Take the object onto a peg or off it, as it passes the peg's top, and count where it rests.

    Args:
        p: Parameters.
        s: State; written.
        before: Its height before this tick [m].
    """
    top = p.place[2] + p.peg_height
    if s.object[2] >= top:
        s.peg = _NONE
    elif before >= top:
        s.peg = _peg_at(p, s.object[0], s.object[1])
    elif s.peg != _NONE:
        _keep_on(p, s)
    rests = s.object[2] <= p.place[2] and not (s.is_between and s.force > 0.0)
    if p.pegs and rests and s.peg != s.homes[s.number]:
        s.homes[s.number] = s.peg
        if s.peg == _NONE:
            s.dropped += 1
        else:
            s.transferred += 1


@inner
def _choose(p: GripNumbers, s: GripState, tip: geometry.Array) -> None:
    """Where the object rests and no finger is at it, take the one that the tip has come to."""
    if s.is_between or s.is_gripped or s.object[2] > p.place[2]:
        return
    for i in range(p.objects):
        square = 0.0
        for k in range(3):
            square += (s.objects[7 * i + k] - tip[k]) ** 2
        if i != s.number and square <= 0.25 * p.size * p.size:
            copy(s.object, s.objects[7 * s.number : 7 * s.number + 7])
            copy(s.objects[7 * i : 7 * i + 7], s.object)
            s.number, s.peg = i, s.homes[i]
            s.motion[0] = s.motion[1] = s.motion[2] = 0.0
            return


@inner
def tell_board(p: GripNumbers, s: GripState, board: geometry.Array) -> None:
    """Write counts, the peg's pull and the objects' middles as slave/jaw/board has them."""
    board[0], board[1], board[2] = s.transferred, s.dropped, s.pull
    for i in range(p.objects):
        for k in range(3):
            board[3 + 3 * i + k] = s.object[k] if i == s.number else s.objects[7 * i + k]


@kernel
def put_objects(p: GripNumbers, s: GripState, places: geometry.Array) -> None:
    """Put all objects where they stand at first, upright.

    Args:
        p: Parameters.
        s: State; written.
        places: Middles of the objects (N, 3) [m].
    """
    for i in range(len(places)):
        pose = s.objects[7 * i : 7 * i + 7]
        copy(places[i], pose[:3])
        pose[3] = 1.0
        s.homes[i] = _peg_at(p, pose[0], pose[1])
    copy(s.objects[:7], s.object)
    s.peg = s.homes[0]


@inner
def move_object(p: GripNumbers, s: GripState, room: GripRoom, row: Row) -> None:
    """Move the object on to the stamp of the newest slave_true_cp, and write where it is.

    Args:
        p: Parameters.
        s: State, with the force of the fingers; written.
        room: :class:`GripRoom`; written.
        row: Signals.
    """
    tip, elapsed_ns = row.slave_true_cp, row.slave_true_cp_ns - s.tip_ns
    if elapsed_ns <= 0:  # no tip is known yet, or no newer one
        return
    is_first, dt = s.tip_ns == 0, 1e-9 * elapsed_ns
    s.tip_ns = row.slave_true_cp_ns
    if is_first:
        copy(tip, s.tip)
    _choose(p, s, tip)
    _tip_motion(s, room, tip, dt)
    s.motion[2] -= WEIGHT * dt
    is_on_table = s.object[2] <= p.place[2]
    if is_on_table:
        s.motion[2] = max(s.motion[2], 0.0)
    if s.is_between and s.force > 0.0:
        left = _rub(p, s, room, _meet_peg(p, s, room, dt), dt)
        _slide(s, left * dt)
        if left == 0.0:
            geometry.multiply_quaternions(room.turn, s.object[3:7], room.turned)
            copy(room.turned, s.object[3:7])
    elif is_on_table:
        s.motion[0] = s.motion[1] = s.pull = 0.0
    else:
        copy(s.motion, room.motion)
        _meet_peg(p, s, room, dt)
    before = s.object[2]
    for i in range(3):
        s.object[i] += s.motion[i] * dt
    if s.object[2] < p.place[2]:
        s.object[2], s.motion[2] = p.place[2], 0.0
    copy(tip, s.tip)
    _count(p, s, _find(p, s, tip))
    _thread(p, s, before)
