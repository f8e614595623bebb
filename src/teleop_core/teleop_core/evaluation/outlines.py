"""Outlines: virtual fixtures as a page draws them, in space, per plane and against time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.chain.fixtures.box import BOX
from teleop_core.chain.fixtures.reported_fixture import ReportedFixture
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import DRAWN_FIXTURES, FIXTURE
from teleop_core.evaluation.state_history import States
from teleop_core.kernels.geometry import Array

_SECOND_NS = 1e9


@dataclass(frozen=True, eq=False)
class Outline:
    """A fixture that was on for a while.

    Attributes:
        begin_s: When it came on, from the start of the recording, [s].
        end_s: When it went, [s].
        kind: Name of its kind.
        points: One line along its edges in the slave's base, shape (N, 3), [mm]; NaN lifts the pen.
    """

    begin_s: float
    end_s: float
    kind: str
    points: Array

    def walls(self, axis: int) -> tuple[float, float]:
        """Places of its two ends along an axis, [mm]."""
        places = self.points[:, axis]
        return float(np.nanmin(places)), float(np.nanmax(places))

    @property
    def size(self) -> list[float]:
        """From end to end along the three axes, [mm]."""
        return [high - low for low, high in map(self.walls, range(3))]

    @property
    def place(self) -> tuple[str, bytes]:
        """The same for fixtures of one kind and size at one place."""
        return self.kind, np.round(self.points, 6).tobytes()

    def wall_lines(self, axis: int, suffix: str) -> list[dict[str, Any]]:
        """Shapes of its two ends along an axis, against time."""
        return [
            {
                "type": "line", "xref": "x", "yref": f"y{suffix}", "x0": self.begin_s,
                "x1": self.end_s, "y0": wall, "y1": wall,
                "line": {"color": FIXTURE, "width": 1.5, "dash": "dash"},
            }
            for wall in self.walls(axis)
        ]  # fmt: skip


def outlines_of(context: Context) -> list[Outline]:
    """Outlines in the order of time; one per fixture, place and stretch of time.

    A fixture whose shape is not known here is drawn as the box around it.
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
            points = 1e3 * (states.center[row] + _around(fixture, states, row, context))
            out.append(Outline(begin, (end_ns - start_ns) / _SECOND_NS, fixture.kind, points))
    return out


def _around(fixture: ReportedFixture, states: States, row: int, context: Context) -> Array:
    """Points (N, 3) [m] around the middle of the fixture of a row."""
    if fixture.fault:
        fixture = ReportedFixture(BOX.name, size=tuple(states.size[row].tolist()))
    return fixture.outline(float(states.column("gain")[row]), context.origin.axes)


def largest(outlines: Sequence[Outline]) -> list[Outline]:
    """Those that were on longest, one per place."""
    lengths: dict[tuple[str, bytes], float] = {}
    one: dict[tuple[str, bytes], Outline] = {}
    for outline in outlines:
        place = outline.place
        lengths[place] = lengths.get(place, 0.0) + outline.end_s - outline.begin_s
        one[place] = outline
    longest = sorted(one, key=lambda place: -lengths[place])[:DRAWN_FIXTURES]
    return [one[place] for place in longest]


def kinds_of(outlines: Sequence[Outline]) -> str:
    """Names of their kinds in words: "box", "box and sphere"."""
    return " and ".join(dict.fromkeys(outline.kind for outline in outlines))
