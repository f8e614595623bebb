"""Tails: paths of the last seconds as lines that fade."""

import numpy as np
import viser

from teleop_console.look import Color
from teleop_core.kernels.geometry import Array

LENGTH = 10.0
"""Time that a tail shows [s]."""
PERIOD = 0.25
"""Time between two drawings of a tail [s]."""
_POINTS = 160
_GAP = 1.0  # gap between two drawings that counts as a jump of time [s]
_SHORTEST = 1e-4  # smallest distance between two points of the tail [m]


def is_jump(before: float, time: float) -> bool:
    """Whether a time [s] is before the previous one, or so long after it that time has jumped."""
    return time < before or time > before + _GAP


class Tail:
    """Path of a point; it needs few messages, and their size is constant.

    Args:
        server: The page.
        name: Path of the tail's node.
        color: Colour of the newest part.
        thickness: Thickness of the line [px].
    """

    def __init__(self, server: viser.ViserServer, name: str, color: Color, thickness: float = 2.5) -> None:
        self._times = np.full(_POINTS + 1, -np.inf)
        self._points = np.zeros((_POINTS + 1, 3))
        self._color = np.array(color, np.float64)
        self._sampled = self._drawn = self._last = -np.inf
        self._background = np.full(3, 255.0)
        self._is_hidden = False
        self._line = server.scene.add_line_segments(
            name,
            np.zeros((_POINTS, 2, 3), np.float32),
            np.zeros((_POINTS, 2, 3), np.uint8),
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )

    def set_background(self, color: Color) -> None:
        """Set the colour into which the tail fades."""
        self._background = np.array(color, np.float64)
        self._drawn = -np.inf

    def show(self, *, is_shown: bool) -> None:
        """Show or hide the tail; a hidden tail still stores points."""
        self._is_hidden = not is_shown
        self._line.visible = is_shown and bool(np.isfinite(self._times[-1]))

    def draw(self, time: float, point: Array | None) -> None:
        """Add the position of the point (3,) [m] at a time [s]; None if the position is unknown.

        A time before the last time, or long after it, starts a new tail.
        """
        if is_jump(self._last, time):
            self.fill(np.empty(0), np.empty((0, 3)))
        self._last = time
        if point is not None and time >= self._sampled + LENGTH / _POINTS:
            self._append(time, point)
        if time >= self._drawn + PERIOD:
            self._drawn = time
            self._redraw(time)

    def fill(self, times: Array, points: Array) -> None:
        """Replace the tail by a whole path: times (N,) [s], ascending, and points (N, 3) [m]."""
        count = min(len(times), _POINTS + 1)
        chosen = np.linspace(0, max(0, len(times) - 1), count).astype(int)
        self._times[:] = -np.inf
        if count:
            self._times[-count:], self._points[-count:] = times[chosen], points[chosen]
        self._sampled = self._last = float(self._times[-1])
        self._drawn = -np.inf

    def _append(self, time: float, point: Array) -> None:
        is_new = not np.isfinite(self._times[-1])
        if not is_new and np.abs(point - self._points[-1]).max() < _SHORTEST:
            return
        self._times[:-1], self._points[:-1] = self._times[1:].copy(), self._points[1:].copy()
        self._times[-1], self._points[-1] = time, point
        self._sampled = time

    def _redraw(self, time: float) -> None:
        """Send the segments of the tail; segments that are too old have no length."""
        age = np.clip((time - self._times) / LENGTH, 0.0, 1.0)
        kept = np.flatnonzero(age < 1.0)
        if not len(kept):
            self._line.visible = False
            return
        places = self._points.copy()
        places[: kept[0]] = places[kept[0]]
        pairs = np.stack((places[:-1], places[1:]), axis=1)
        shade = self._color + age[:, None] * (self._background - self._color)
        self._line.points = pairs.astype(np.float32)
        self._line.colors = np.stack((shade[:-1], shade[1:]), axis=1).astype(np.uint8)
        self._line.visible = not self._is_hidden
