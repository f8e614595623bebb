"""Motion: speeds and accelerations of setpoints and joints, as control laws estimate them.

A law sees positions alone. Its setpoint and its joint each pass a fading-memory filter of the
second degree, which follows a constant acceleration without lag; that of the joint is told which
acceleration the law expects of its own effort, and so finds what else accelerates it. Both have the
same memory, so that their difference is that of motions of the same age.

Every law keeps the first :data:`MEMORY` numbers of a joint for this, by the names below.

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
"""Numbers of each joint that :func:`follow_motion` and :func:`friction_of_setpoint` keep."""
PLACE, SPEED, UNEXPLAINED = 0, 1, 2
"""Of the joint: position, speed, and acceleration beside the expected one."""
SET_PLACE, SET_SPEED, SET_ACCELERATION = 3, 4, 5
"""Of its setpoint: position, speed, acceleration."""
EXPECTED = 6
"""Expected acceleration of the joint, which the law writes."""
_LAST_SETPOINT, _BENT = 7, 8
EFFORT_SHARE = 0.02
FRICTION_SHARE = 0.5
"""What one encoder count may change of an effort: shares of the drive's limit, of dry friction."""
APPROACH_SHARE = 0.5
"""Share of a drive's limit that an error may take before it counts as less, see approach()."""
SLOWEST_RATIO = 2.0
"""Pole of the filters over that of the loop, at the least."""
_HALVINGS = 50


@kernel
def follow(memory: Array, at: int, value: float, expected: float, fading: float, dt: float) -> None:
    """Take the next value of a position into its estimates, ``memory[at:at + 3]``.

    Args:
        memory: Numbers of one joint; position, speed and acceleration (beside the expected one) are written.
        at: Where they begin.
        value: Position [rad or m].
        expected: Acceleration since the last value, as far as it is known [rad/s² or m/s²].
        fading: Share of what is remembered after a tick, 0 to 1: all three poles of the error.
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
    """Take the next setpoint and the next measured position of a joint into their estimates."""
    follow(memory, PLACE, measured, memory[EXPECTED], fading, dt)
    follow(memory, SET_PLACE, setpoint, 0.0, fading, dt)


@kernel
def friction_of_setpoint(memory: Array, setpoint: float, most: float, travel: float) -> float:
    """Dry friction of a joint that moves as its setpoint does, smooth over a small travel.

    A bristle that bends with the setpoint until it carries the friction, and slips then: it keeps its value when the
    setpoint rests, turns over ``2 travel`` when it turns, and never chatters, whatever is measured.

    Args:
        memory: Numbers of one joint, as :func:`follow_motion` has them; written.
        setpoint: Wanted position [rad or m].
        most: Dry friction [N·m or N], >= 0.
        travel: Way over which it is built up [rad or m], > 0.

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
    """Error to act on: a setpoint too far for the drive counts as nearer, so that it can brake.

    Beyond ``linear`` [rad or m] the error D counts as ``√(linear (2 D - linear))``; the speed of
    approach then falls with the root of what is left, as that of a constant deceleration does.
    """
    gap = abs(error)
    if gap <= linear:
        return error
    return math.copysign(math.sqrt(linear * (2.0 * gap - linear)), error)


@kernel
def closeness(error: float, linear: float) -> float:
    """Share of the setpoint's motion to feed forward: 1 where :func:`approach` acts on the error.

    It falls to 0 at twice that distance: a joint that is far behind catches up, and follows no motion.
    """
    return min(max(2.0 - abs(error) / linear, 0.0), 1.0)


@kernel
def beyond(value: float, room: float) -> float:
    """What a value has beyond ±room; 0 inside."""
    return value - min(max(value, -room), room)


def begin_motion(memory: Array, measured: Array, _effort: Array) -> None:
    """Let the estimates of all joints (n, m) begin at rest at ``measured`` (n,)."""
    memory[:, PLACE] = memory[:, SET_PLACE] = memory[:, _LAST_SETPOINT] = measured


def holding(column: int) -> tuple[Begin, Shift]:
    """``begin`` and ``shift`` of a law one column of whose memory holds the arm at rest.

    It starts at rest with all the effort that the arm needs there, and takes over what the feedforward no longer gives.
    """

    def begin(memory: Array, measured: Array, effort: Array) -> None:
        begin_motion(memory, measured, effort)
        memory[:, column] = effort

    def shift(memory: Array, effort: Array) -> None:
        memory[:, column] += effort

    return begin, shift


def linear_range(robot: Robot, pole: Array, stiffness: float) -> Array:
    """Largest error (n,) that :func:`approach` leaves as it is; ``stiffness`` as in fading_of()."""
    drives = robot.drives
    assert drives is not None
    share = APPROACH_SHARE * drives.effort_limit
    return np.asarray(share / (stiffness * pole**2 * drives.inertia), dtype=np.float64)


def known_friction(robot: Robot) -> Array:
    """Dry friction (n,) as it was identified, on average, else that of the drive table."""
    assert robot.drives is not None
    return robot.drives.coulomb if robot.hardware is None else robot.hardware.coulomb


def fading_of(
    robot: Robot, pole: Array, ratio: float, *, stiffness: float, damping: float, rejection: float = 0.0
) -> Array:
    """Fading (n,) of the filters of a law, as fast as its own noise allows.

    The rule: ``ratio`` times as fast as the loop, but so slow that one encoder count changes the effort by no more than
    :data:`EFFORT_SHARE` of the drive's limit. It also changes it by no more than :data:`FRICTION_SHARE` of known dry
    friction, so that the noise of an encoder shakes no joint loose. It is :data:`SLOWEST_RATIO` times as fast all the
    same, without which the loop would not be damped.

    Args:
        robot: Robot with drives.
        pole: Of the closed loop (n,) [rad/s].
        ratio: Pole of the filters over that of the loop, >= 1.
        stiffness: Proportional action over ``inertia pole²``.
        damping: Action on the speed over ``inertia pole``.
        rejection: Action on the unexplained acceleration over ``inertia``.

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
    """Acceleration (n,) asked for when a position jumps by one, at once [1/s²]."""
    fading = exponential(-bandwidth * DT)
    speed = 1.5 * (1.0 - fading) ** 2 * (1.0 + fading) / DT
    unexplained = (1.0 - fading) * (1.0 - fading) ** 2 / DT**2
    return np.asarray(stiffness * pole**2 + damping * pole * speed + rejection * unexplained, dtype=np.float64)
