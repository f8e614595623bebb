"""Follower: a stylus that follows wanted poses smoothly, with a stated delay and bounded motion.

Position and attitude each follow as a critically damped system of second order. Speed, acceleration and position are
bounded. So a jump of the wanted pose never becomes a jump of the stylus.
"""

import math
from typing import Any

import numpy as np

from teleop_core.kernels import bound, inner, kernel
from teleop_core.kernels.fields import Fields, PoseRow, Quaternion, Vector3, record, record_array
from teleop_core.kernels.geometry import Array, turn_between, turn_by

MOST = 4
"""Largest number of ticks per call. A new target takes effect at most this many ticks late."""


class Wanted(Fields):
    """Pose, buttons, tremor and jaw that a hand wants in a tick, in the master's base."""

    wanted: Vector3  # position of the stylus [m]
    attitude: Quaternion
    buttons: Vector3  # clutch, fixture, mode: 1 pressed
    tremor: Vector3  # [m]
    jaw: float  # 0 open, 1 closed


class Bounds(Fields):
    """Bounds of a stylus that follows."""

    rate: float  # twice the inverse of the delay [1/s]
    speed: float  # largest values [m/s, m/s², rad/s, rad/s²]
    acceleration: float
    turn_speed: float
    turn_acceleration: float
    low: Vector3  # low corner of the stylus's range [m]; the high corner follows
    high: Vector3


class FollowerState(Fields):
    """State of a stylus that follows."""

    time: float  # [s]
    next: float  # time of the next tick [s]
    tick: float  # length of a tick [s]
    pose: PoseRow
    velocity: Vector3
    turning: Vector3
    target: PoseRow
    buttons: Vector3


@kernel
def follow(b: Bounds, s: FollowerState, rows: Any) -> None:
    """Follow the target for some ticks, and write the pose of the stylus in each tick.

    Args:
        b: Bounds.
        s: State; written.
        rows: Records (N,) of :class:`Wanted`; all fields except the tremor are written.
    """
    gap, turn = np.empty(3), np.empty(3)
    for k in range(rows.shape[0]):
        row, h = rows[k], max(s.next - s.time, 0.0)
        s.time += h
        s.next += s.tick
        for i in range(3):
            gap[i] = min(max(s.target[i], b.low[i]), b.high[i]) - s.pose[i]
        turn_between(s.pose[3:7], s.target[3:7], turn)
        _approach(gap, s.velocity, b.rate, b.speed, b.acceleration, h)
        _approach(turn, s.turning, b.rate, b.turn_speed, b.turn_acceleration, h)
        for i in range(3):
            place = s.pose[i] + h * s.velocity[i]
            s.pose[i] = min(max(place, b.low[i]), b.high[i])
            turn[i] = h * s.turning[i]
        turn_by(turn, s.pose[3:7])
        _normalise(s.pose[3:7])
        for i in range(3):
            row.wanted[i] = s.pose[i]
            row.buttons[i] = s.buttons[i]
        for i in range(4):
            row.attitude[i] = s.pose[3 + i]


@inner
def _approach(gap: Array, velocity: Array, rate: float, fastest: float, hardest: float, h: float) -> None:
    """Change a velocity (3,) over ``h`` [s] so that a gap (3,) closes with critical damping.

    The wanted velocity is so small that half of the allowed acceleration can stop it in time.
    """
    far = math.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])
    fast = min(0.5 * rate * far, fastest, math.sqrt(0.5 * hardest * far))
    share = fast / far if far > 0.0 else 0.0
    change, square = np.empty(3), 0.0
    for i in range(3):
        change[i] = min(2.0 * rate * h, 1.0) * (share * gap[i] - velocity[i])
        square += change[i] * change[i]
    most, size = hardest * h, math.sqrt(square)
    cut = most / size if size > most else 1.0
    for i in range(3):
        velocity[i] += cut * change[i]


@inner
def _normalise(quaternion: Array) -> None:
    square = 0.0
    for i in range(4):
        square += quaternion[i] * quaternion[i]
    for i in range(4):
        quaternion[i] /= math.sqrt(square)


class Follower:
    """Stylus that follows wanted poses.

    Args:
        delay: Delay behind a steady motion [s], > 0.
        speed: Largest linear and angular speed [m/s, rad/s].
        acceleration: Largest linear and angular acceleration [m/s², rad/s²].
        start: Pose (7,) in which it starts at rest: position [m], quaternion w, x, y, z.
        room: Low and high corner (3,) [m] of the box that bounds the stylus.
    """

    def __init__(
        self,
        delay: float,
        speed: tuple[float, float],
        acceleration: tuple[float, float],
        start: Array,
        room: tuple[Array, Array],
    ) -> None:
        self._bounds, self._state = record(Bounds), record(FollowerState)
        b, s = self._bounds, self._state
        b["rate"] = 2.0 / delay
        b["speed"], b["turn_speed"] = speed
        b["acceleration"], b["turn_acceleration"] = acceleration
        b["low"], b["high"] = room
        s["pose"] = s["target"] = start
        self._rows = [record_array(Wanted, count) for count in range(MOST + 1)]
        self._follow = [bound(follow, b, s, rows) for rows in self._rows]

    @property
    def time(self) -> float:
        """Time up to which the motion is computed [s]."""
        return float(self._state["time"])

    @property
    def pose(self) -> Array:
        """Present pose (7,); a copy."""
        return np.array(self._state["pose"])

    def aim(self, pose: Array) -> None:
        """Move towards a pose (7,) from now on."""
        self._state["target"] = pose

    def brake(self) -> None:
        """Brake to rest from now on, as soon as possible without moving back."""
        s, b = self._state, self._bounds
        s["target"] = s["pose"]
        s["target"][:3] += s["velocity"] / b["rate"]
        turn_by(s["turning"] / b["rate"], s["target"][3:])

    def press(self, buttons: tuple[bool, ...]) -> None:
        """Set the states of the buttons clutch, fixture and mode from now on."""
        self._state["buttons"] = buttons

    def go_on(self, first: float, tick: float, count: int) -> Any:
        """Continue the motion for some ticks.

        Args:
            first: Time of the first tick [s], not before :attr:`time`.
            tick: Length of a tick [s].
            count: Number of ticks, 1 to :data:`MOST`.

        Returns:
            Records (count,) of :class:`Wanted`; the next call overwrites them.
        """
        self._state["next"], self._state["tick"] = first, tick
        self._follow[count]()
        return self._rows[count]
