"""Outlines: virtual fixtures as a page draws them, in space, per plane and against time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.coupling.fixtures.reported_fixture import ReportedFixture
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import DRAWN_FIXTURES, FIXTURE
from teleop_core.evaluation.state_history import States
from teleop_core.kernels.geometry import Array
from teleop_core.shapes.box import BOX

_SECOND_NS = 1e9
_FAR = 1.0  # walls are searched up to this distance at the hand [m]
_STEPS = 1001  # number of points that each round of the search tests
_ROUNDS = 3  # number of rounds of the search; each round has finer steps
_GRAZED = 1e-9  # smaller depths are rounding errors [m]


@dataclass(frozen=True, eq=False)
class Outline:
    """A fixture that was on for a while.

    Attributes:
        begin_s: Time at which the fixture was switched on, since the start of the recording, [s].
        end_s: Time at which the fixture was switched off, [s].
        kind: Name of the fixture's kind.
        points: One line along the fixture's edges in the slave's base, shape (N, 3), [mm]; NaN interrupts the line.
        walls: Positions of the walls on each axis (3, 2) [mm]: the first wall in negative and in positive direction
            from the middle; NaN if there is no wall.
    """

    begin_s: float
    end_s: float
    kind: str
    points: Array
    walls: Array

    @property
    def size(self) -> list[float]:
        """Size along the three axes, [mm]; empty for a shape that has no wall in some direction."""
        if not np.isfinite(self.walls).all():
            return []
        extent: list[float] = (np.nanmax(self.points, axis=0) - np.nanmin(self.points, axis=0)).tolist()
        return extent

    @property
    def place(self) -> tuple[str, bytes]:
        """Key that is equal for fixtures of the same kind and size at the same position."""
        return self.kind, np.round(self.points, 6).tobytes()

    def wall_lines(self, axis: int, suffix: str) -> list[dict[str, Any]]:
        """Lines of the fixture's walls on an axis, against time."""
        return [
            {
                "type": "line",
                "xref": "x",
                "yref": f"y{suffix}",
                "x0": self.begin_s,
                "x1": self.end_s,
                "y0": wall,
                "y1": wall,
                "line": {"color": FIXTURE, "width": 1.5, "dash": "dash"},
            }
            for wall in self.walls[axis].tolist()
            if math.isfinite(wall)
        ]


def outlines_of(context: Context) -> list[Outline]:
    """Outlines in the order of time; one per fixture, position and time interval.

    A fixture of unknown shape is drawn as its bounding box.
    """
    history, start_ns = context.history, context.bag.start_ns
    states = States(history.rows, history.fixture, history.fixtures)
    is_on, which = states.is_fixture_on, states.fixture[:, None]
    places = np.concatenate((states.center, states.size, is_on[:, None], which), axis=1)
    begins = np.flatnonzero((np.diff(places, axis=0, prepend=np.nan) != 0.0).any(axis=1))
    ends = np.append(history.stamp_ns[begins[1:]], context.bag.end_ns)[: len(begins)]
    out = []
    for row, end_ns in zip(begins.tolist(), ends.tolist(), strict=True):
        if is_on[row]:
            fixture = states.fixtures[int(states.fixture[row])]
            begin = max(0.0, (int(history.stamp_ns[row]) - start_ns) / _SECOND_NS)
            drawn = fixture
            if fixture.fault:
                drawn = ReportedFixture(BOX.name, size=tuple(states.size[row].tolist()))
            points, walls = _around(drawn, float(states.column("gain")[row]), context.origin.axes)
            middle, end = states.center[row], (end_ns - start_ns) / _SECOND_NS
            points, walls = 1e3 * (middle + points), 1e3 * (middle[:, None] + walls)
            out.append(Outline(begin, end, fixture.kind, points, walls))
    return out


def _around(fixture: ReportedFixture, gain: float, axes: Array) -> tuple[Array, Array]:
    """Points (N, 3) [m] of a fixture's edges, and positions (3, 2) [m] of its walls on the axes.

    Both are relative to the fixture's middle.
    """
    points = fixture.outline(gain, axes)
    if fixture.size:  # a box: only its size is reported
        return points, np.stack((points.min(axis=0), points.max(axis=0)), axis=1)
    walls = np.full((3, 2), np.nan)
    for axis in range(3):
        for side, sign in enumerate((-1.0, 1.0)):
            way = sign * np.eye(3)[axis]
            walls[axis, side] = sign * _first_wall(fixture, way, gain, axes)
    return points, walls


def _first_wall(fixture: ReportedFixture, way: Array, gain: float, axes: Array) -> float:
    """Distance [m] from the middle to the first wall in the direction of a unit vector (3,); NaN without a wall."""
    low, high = 0.0, _FAR * gain
    for _ in range(_ROUNDS):
        places = np.linspace(low, high, _STEPS)
        depths = fixture.depths(places[:, None] * way, np.full(_STEPS, gain), axes)
        outside = depths > _GRAZED * gain
        if not outside.any():
            return math.nan
        first = max(int(outside.argmax()), 1)
        low, high = float(places[first - 1]), float(places[first])
    return high


def largest(outlines: Sequence[Outline]) -> list[Outline]:
    """The outlines that were on for the longest time, one per position."""
    lengths: dict[tuple[str, bytes], float] = {}
    one: dict[tuple[str, bytes], Outline] = {}
    for outline in outlines:
        place = outline.place
        lengths[place] = lengths.get(place, 0.0) + outline.end_s - outline.begin_s
        one[place] = outline
    longest = sorted(one, key=lambda place: -lengths[place])[:DRAWN_FIXTURES]
    return [one[place] for place in longest]


def kinds_of(outlines: Sequence[Outline]) -> str:
    """Text with the names of the outlines' kinds: "box", "box and sphere"."""
    return " and ".join(dict.fromkeys(outline.kind for outline in outlines))
