"""Glances: data that a visually guided operator has recently seen and felt, interpolated in time."""

import math
from collections import deque
from typing import NamedTuple

from teleop_core.hand.operators import Seen
from teleop_core.kernels import Array, length

STILL_TIME = 0.02
"""A motion is at rest if it changes little in this time [s]."""
SETTLED_TIME = 0.1
"""A motion that did not end where the hand felt it end is at rest if it changes little in this time [s]."""
_FRAME = 0.01  # frames are told apart if the tip was measured so much later [s]; clocks of live sessions jitter by less


class Glance(NamedTuple):
    """Data seen and felt at a time [s]: tip (7,) and goal (3,) [m] on the screen, force on the hand (3,) [N].

    ``before`` is the tip (7,) on the frame before, if it stood for more than :data:`SETTLED_TIME`; otherwise ``tip``.
    """

    time: float
    tip: Array
    goal: Array
    force: Array
    before: Array


class Glances:
    """Memory of an operator who corrects by sight.

    Args:
        eye: Delay after which a glance can be used [s].
    """

    def __init__(self, eye: float) -> None:
        self._eye = eye
        self._kept: deque[Glance] = deque()
        self._measured = -math.inf  # time at which the tip on the screen was measured [s]
        self._before: Array | None = None  # tip on the frame before, if that frame stood long

    def __bool__(self) -> bool:
        return bool(self._kept)

    def take(self, now: float, seen: Seen, goal: Array) -> None:
        """Store the data seen and felt at a time [s], and drop glances that are no longer needed."""
        kept = self._kept
        if seen.slave[:3].any():  # otherwise no pose has been shown yet
            tip = seen.slave.copy()
            self._notice_frame(now - seen.age())
            before = tip if self._before is None else self._before
            kept.append(Glance(now, tip, goal.copy(), seen.force[:3].copy(), before))
        while len(kept) > 2 and kept[1].time <= now - self._eye - SETTLED_TIME:
            kept.popleft()

    def _notice_frame(self, measured: float) -> None:
        """Store the frame before if a new one came, whose tip was measured at a time [s]."""
        if measured > self._measured + _FRAME:
            is_rare = len(self._kept) > 0 and measured - self._measured > SETTLED_TIME
            self._before = self._kept[-1].tip if is_rare else None
            self._measured = measured

    def covers(self, when: float) -> bool:
        """Whether the glance that can be used at a time [s] was taken."""
        return bool(self._kept) and self._kept[0].time <= when - self._eye

    def at(self, when: float) -> Glance:
        """Glance that can be used at a time [s]: the data one eye delay earlier, interpolated between two glances."""
        at, kept = when - self._eye, self._kept
        later = next((i for i, glance in enumerate(kept) if glance.time > at), len(kept))
        if later in {0, len(kept)}:
            return kept[min(later, len(kept) - 1)]
        a, b = kept[later - 1], kept[later]
        share = (at - a.time) / (b.time - a.time)
        return Glance(at, *(x + share * (y - x) for x, y in zip(a[1:], b[1:], strict=True)))

    def since(self, begin: float, until: float) -> list[Glance]:
        """Glances from the time ``begin`` [s] on that can be used at the time ``until`` [s]."""
        return [glance for glance in self._kept if begin <= glance.time <= until - self._eye]

    def speed_of_goal(self, width: float) -> Array:
        """Velocity of the goal (3,) [m/s] since the goal last jumped by more than its width [m]."""
        seen = self._since_jump(width)
        return _speed(seen[0], seen[-1])

    def way_of_goal(self, width: float, time: float) -> Array:
        """Way (3,) [m] that the goal will go in a time [s], if it goes on to accelerate as it was seen to do.

        Args:
            width: Width of the goal [m]; after a jump by more than this the memory begins anew.
            time: Time from now on [s].
        """
        seen = self._since_jump(width)
        first, middle, last = seen[0], seen[len(seen) // 2], seen[-1]
        lasted = last.time - first.time
        acceleration = (_speed(middle, last) - _speed(first, middle)) / max(0.5 * lasted, 1e-9)
        now = _speed(first, last) + 0.5 * lasted * acceleration
        return time * now + 0.5 * time * time * acceleration

    def _since_jump(self, width: float) -> list[Glance]:
        """Latest glances, since the goal last jumped by more than its width [m]; at least one."""
        seen = [self._kept[-1]]
        begin = seen[0].time - self._eye - STILL_TIME
        for glance in reversed(self._kept):
            if glance.time <= begin or float(length(seen[-1].goal - glance.goal)) > width:
                break
            seen.append(glance)
        return seen[:0:-1] or seen


def crossing(seen: list[tuple[float, float]], level: float) -> float:
    """Time [s] at which values rise to a level, interpolated between pairs of time and value; infinite if never."""
    before: tuple[float, float] | None = None
    for time, value in seen:
        if value >= level:
            if before is None or value <= before[1]:
                return time
            return before[0] + (level - before[1]) / (value - before[1]) * (time - before[0])
        before = (time, value)
    return math.inf


def _speed(a: Glance, b: Glance) -> Array:
    """Mean velocity of the goal (3,) [m/s] between two glances; zero if they are the same."""
    return (b.goal - a.goal) / max(b.time - a.time, 1e-9)
