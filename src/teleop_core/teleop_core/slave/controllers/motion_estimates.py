"""Motion: speeds and accelerations of setpoints and joints, as control laws estimate them.

A control law gets positions alone. Setpoint and joint position each pass a fading-memory filter of the second degree,
which follows a constant acceleration without lag. The filter of the joint also gets the acceleration that the law
expects from its own effort, and so estimates the unexplained acceleration. Both filters have the same time constant, so
their outputs have the same delay and can be compared.

Every law reserves the first :data:`MEMORY` numbers of each joint's memory for these estimates, under the names below.

Source:
    Morrison 1969, Introduction to Sequential Smoothing and Prediction, chapter 13; Brookner 1998,
    Tracking and Kalman Filtering Made Easy, table 1.3.2 (critically damped g-h-k filter).
"""

import math

import numpy as np

from teleop_core.graph import DT
from teleop_core.kernels import Array, kernel
from teleop_core.kernels.portable import exponential
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Begin, Shift

MEMORY = 9
"""Number of values per joint that :func:`follow_motion` and :func:`friction_of_setpoint` store."""
PLACE, SPEED, UNEXPLAINED = 0, 1, 2
"""Columns of estimates of the joint: position, speed, and unexpected acceleration."""
SET_PLACE, SET_SPEED, SET_ACCELERATION = 3, 4, 5
"""Columns of estimates of the joint's setpoint: position, speed, acceleration."""
EXPECTED = 6
"""Column of the expected acceleration of the joint; the law writes it."""
_LAST_SETPOINT, _BENT = 7, 8
EFFORT_SHARE = 0.02
"""Largest change of effort by one encoder count, divided by the drive's limit."""
FRICTION_SHARE = 0.5
"""Largest change of effort by one encoder count, divided by the dry friction."""
APPROACH_SHARE = 0.5
"""Share of a drive's limit that an error may use before the error is reduced; see approach()."""
SLOWEST_RATIO = 2.0
"""Smallest pole of the filters, divided by the pole of the loop."""
_HALVINGS = 50


@kernel
def follow(memory: Array, at: int, value: float, expected: float, fading: float, dt: float) -> None:
    """Update the estimates of a position, ``memory[at:at + 3]``, with its next value.

    Args:
        memory: Numbers of one joint; position, speed and unexpected acceleration are written.
        at: Index of the first of these three numbers.
        value: Position [rad or m].
        expected: Known part of the acceleration since the last value [rad/s² or m/s²].
        fading: Share of the memory that remains after a tick, 0 to 1; it is the triple pole of the estimation error.
        dt: Tick [s], > 0.
    """
    acceleration = memory[at + 2] + expected
    memory[at] += dt * memory[at + 1] + 0.5 * dt * dt * acceleration
    memory[at + 1] += dt * acceleration
    off, new = value - memory[at], 1.0 - fading
    memory[at] += (1.0 - fading * fading * fading) * off
    memory[at + 1] += 1.5 * new * new * (1.0 + fading) / dt * off
    memory[at + 2] += new * new * new / (dt * dt) * off


@kernel
def follow_motion(memory: Array, setpoint: float, measured: float, fading: float, dt: float) -> None:
    """Update the estimates of a joint with its next setpoint and its next measured position."""
    follow(memory, PLACE, measured, memory[EXPECTED], fading, dt)
    follow(memory, SET_PLACE, setpoint, 0.0, fading, dt)


@kernel
def friction_of_setpoint(memory: Array, setpoint: float, most: float, travel: float) -> float:
    """Dry friction of a joint that moves as its setpoint does, smooth over a small travel.

    The model is a bristle that bends with the setpoint until it carries the friction, and then slips. The friction
    keeps its value while the setpoint rests. After the setpoint turns, the friction changes sign over a travel of ``2
    travel``. It never chatters, because measurements do not affect it.

    Args:
        memory: Numbers of one joint, as in :func:`follow_motion`; written.
        setpoint: Wanted position [rad or m].
        most: Dry friction [N·m or N], >= 0.
        travel: Travel over which the friction builds up [rad or m], > 0.

    Returns:
        Effort along the motion, within ±most.

    Source:
        Dahl 1968; Dupont, Hayward, Armstrong and Altpeter 2002 (elasto-plastic presliding).
    """
    bent = memory[_BENT] + (setpoint - memory[_LAST_SETPOINT]) / travel
    memory[_LAST_SETPOINT], memory[_BENT] = setpoint, min(max(bent, -1.0), 1.0)
    return most * memory[_BENT]


@kernel
def approach(error: float, linear: float) -> float:
    """Reduced error for the control law: a setpoint too far away counts as nearer, so that the drive can brake.

    Beyond ``linear`` [rad or m] the error D counts as ``√(linear (2 D - linear))``. The speed of approach then falls
    with the root of the remaining distance, as under a constant deceleration.
    """
    gap = abs(error)
    if gap <= linear:
        return error
    return math.copysign(math.sqrt(linear * (2.0 * gap - linear)), error)


@kernel
def closeness(error: float, linear: float) -> float:
    """Share of the setpoint's motion to feed forward: 1 where :func:`approach` returns the error unchanged.

    The share falls to 0 at twice that distance: a joint far behind its setpoint only catches up, without feedforward.
    """
    return min(max(2.0 - abs(error) / linear, 0.0), 1.0)


@kernel
def beyond(value: float, room: float) -> float:
    """Part of a value that lies beyond ±room; 0 inside."""
    return value - min(max(value, -room), room)


def begin_motion(memory: Array, measured: Array, _effort: Array) -> None:
    """Initialise the estimates of all joints (n, m): at rest at ``measured`` (n,)."""
    memory[:, PLACE] = memory[:, SET_PLACE] = memory[:, _LAST_SETPOINT] = measured


def holding(column: int) -> tuple[Begin, Shift]:
    """Functions ``begin`` and ``shift`` of a law whose memory contains the effort that holds the arm in one column.

    ``begin`` sets that column to the whole effort that the arm needs at rest. ``shift`` adds the effort that the
    feedforward no longer contains.
    """

    def begin(memory: Array, measured: Array, effort: Array) -> None:
        begin_motion(memory, measured, effort)
        memory[:, column] = effort

    def shift(memory: Array, effort: Array) -> None:
        memory[:, column] += effort

    return begin, shift


def linear_range(robot: Robot, pole: Array, stiffness: float) -> Array:
    """Largest error (n,) that :func:`approach` leaves unchanged; ``stiffness`` as in fading_of()."""
    drives = robot.drives
    assert drives is not None
    share = APPROACH_SHARE * drives.effort_limit
    return np.asarray(share / (stiffness * pole**2 * drives.inertia), dtype=np.float64)


def known_friction(robot: Robot) -> Array:
    """Mean identified dry friction (n,); the drive table's dry friction if none was identified."""
    assert robot.drives is not None
    return robot.drives.coulomb if robot.hardware is None else robot.hardware.coulomb


def fading_of(
    robot: Robot, pole: Array, ratio: float, *, stiffness: float, damping: float, rejection: float = 0.0
) -> Array:
    """Fading (n,) of the filters of a law, as fast as encoder noise allows.

    The filters are ``ratio`` times as fast as the loop, with two upper bounds on their speed. One encoder count changes
    the effort by at most :data:`EFFORT_SHARE` of the drive's limit. It also changes the effort by at most
    :data:`FRICTION_SHARE` of known dry friction, so that encoder noise never makes a stuck joint slip. In any case the
    filters are at least :data:`SLOWEST_RATIO` times as fast as the loop, because with slower filters the loop would
    have too little damping.

    Args:
        robot: Robot with drives.
        pole: Pole of the closed loop (n,) [rad/s].
        ratio: Pole of the filters, divided by that of the loop, >= 1.
        stiffness: Proportional gain, divided by ``inertia pole²``.
        damping: Gain on the speed, divided by ``inertia pole``.
        rejection: Gain on the unexplained acceleration, divided by ``inertia``.

    Source:
        Franklin, Powell and Emami-Naeini 2002, section 7.7: two to six times as fast.
    """
    drives, friction = robot.drives, known_friction(robot)
    assert drives is not None
    room = EFFORT_SHARE * drives.effort_limit
    room = np.where(friction > 0.0, np.minimum(room, FRICTION_SHARE * friction), room)
    allowed = room / (drives.inertia * drives.encoder_step)
    low, high = min(ratio, SLOWEST_RATIO) * pole, ratio * pole
    if_fast = _per_count(high, pole, stiffness, damping, rejection) <= allowed
    slow, fast = low.copy(), high.copy()
    for _ in range(_HALVINGS):
        middle = 0.5 * (slow + fast)
        is_quiet = _per_count(middle, pole, stiffness, damping, rejection) <= allowed
        slow, fast = np.where(is_quiet, middle, slow), np.where(is_quiet, fast, middle)
    return exponential(-np.where(if_fast, high, slow) * DT)


def _per_count(bandwidth: Array, pole: Array, stiffness: float, damping: float, rejection: float) -> Array:
    """Acceleration (n,) that the law demands immediately when a position jumps by one unit [1/s²]."""
    fading = exponential(-bandwidth * DT)
    speed = 1.5 * (1.0 - fading) ** 2 * (1.0 + fading) / DT
    unexplained = (1.0 - fading) * (1.0 - fading) ** 2 / DT**2
    return np.asarray(stiffness * pole**2 + damping * pole * speed + rejection * unexplained, dtype=np.float64)
