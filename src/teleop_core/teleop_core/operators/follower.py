"""Follower: a stylus that follows wanted poses smoothly, with a stated delay and bounded motion.

Place and attitude each follow as a critically damped system of second order. What it wants to do
is bounded: its speed, its acceleration, and the room that it stays in. So no jump of what is wanted
ever comes out as one.
"""

import math
from typing import Any

import numpy as np

from teleop_core.geometry import Array, turn_between, turn_by, turn_within
from teleop_core.kernels import inner, kernel, records

_BOUNDS = [
    ("rate", "f8"), ("speed", "f8"), ("acceleration", "f8"), ("turn_speed", "f8"),
    ("turn_acceleration", "f8"), ("low", "f8", (3,)), ("high", "f8", (3,)), ("start", "f8", (7,)),
]  # fmt: skip
_STATE = [
    ("time", "f8"), ("pose", "f8", (7,)), ("velocity", "f8", (3,)), ("turning", "f8", (3,)),
    ("target", "f8", (7,)),
]  # fmt: skip


@kernel
def follow(b: Any, s: Any, times: Array, rows: Array) -> None:
    """Follow the target up to each time, and write where the stylus is then.

    Args:
        b: Bounds: ``rate`` [1/s], twice the inverse of the delay; largest speeds and accelerations
            [m/s, m/s², rad/s, rad/s²]; the room's corners ``low`` and ``high`` (3,) [m]; and the
            ``start`` (7,), both in the master's base.
        s: State: ``time`` [s], ``pose`` (7,), its velocities, and the ``target`` (7,), at most one
            unit of length off in its quaternion; written.
        times: Rising times (N,) [s]; those that are not later than the state's repeat it.
        rows: Rows (N, 6 or more) of :data:`teleop_core.operators.Motion`; written.
    """
    gap, turn = np.empty(3), np.empty(3)
    for k in range(times.shape[0]):
        h = max(times[k] - s.time, 0.0)
        s.time += h
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
            rows[k, i] = s.pose[i] - b.start[i]
        turn_within(b.start[3:7], s.pose[3:7], rows[k, 3:6])


@inner
def _approach(
    gap: Array, velocity: Array, rate: float, fastest: float, hardest: float, h: float
) -> None:
    """Change a velocity (3,) over ``h`` [s] so that it closes a gap (3,) at critical damping.

    The velocity that it goes for is such that half of the acceleration allowed can end it in time.
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
    """Stylus that goes where it is wanted.

    Args:
        delay: How far it is behind a steady motion [s], > 0.
        speed: Largest speeds of place and turn [m/s, rad/s].
        acceleration: Their largest accelerations [m/s², rad/s²].
        start: Pose (7,) that it starts at rest in: place [m], quaternion w, x, y, z.
        room: Corners low and high (3,) [m] of the box that it stays in.
    """

    def __init__(
        self,
        delay: float,
        speed: tuple[float, float],
        acceleration: tuple[float, float],
        start: Array,
        room: tuple[Array, Array],
    ) -> None:
        self._bounds, self._state = records(_BOUNDS)[0], records(_STATE)[0]
        b, s = self._bounds, self._state
        b["rate"] = 2.0 / delay
        b["speed"], b["turn_speed"] = speed
        b["acceleration"], b["turn_acceleration"] = acceleration
        b["low"], b["high"] = room
        b["start"] = s["pose"] = s["target"] = start

    @property
    def time(self) -> float:
        """Time that it has come to [s]."""
        return float(self._state["time"])

    @property
    def pose(self) -> Array:
        """Where it is now (7,); a copy."""
        return np.array(self._state["pose"])

    def aim(self, pose: Array) -> None:
        """Go for a pose (7,) from now on."""
        self._state["target"] = pose

    def brake(self) -> None:
        """Come to rest from now on, as soon as it can without coming back."""
        s, b = self._state, self._bounds
        s["target"] = s["pose"]
        s["target"][:3] += s["velocity"] / b["rate"]
        turn_by(s["turning"] / b["rate"], s["target"][3:])

    def go_on(self, times: Array) -> Array:
        """Rows (N, 12) of :data:`teleop_core.operators.Motion`: buttons and tremor are zero."""
        rows = np.zeros((len(times), 12))
        follow(self._bounds, self._state, np.ascontiguousarray(times), rows)
        return rows
