"""Boxes: fixtures as a page draws them, in space, per plane and against time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import BOX, DRAWN_BOXES
from teleop_core.evaluation.state_history import States
from teleop_core.geometry import Array

_SECOND_NS = 1e9


@dataclass(frozen=True)
class Box:
    """A box that was on for a while.

    Attributes:
        begin_s: When it came on, from the start of the recording, [s].
        end_s: When it went, [s].
        center: Middle in the slave's base, [mm].
        size: Wall to wall, [mm].
    """

    begin_s: float
    end_s: float
    center: tuple[float, float, float]
    size: tuple[float, float, float]

    def walls(self, axis: int) -> tuple[float, float]:
        """Places of the two walls across an axis, [mm]."""
        half = 0.5 * self.size[axis]
        return self.center[axis] - half, self.center[axis] + half

    def edges(self) -> Array:
        """One line along all edges, shape (N, 3), [mm]."""
        corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0), (0, 0, 1), (1, 0, 1),
                   (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 1, 0),
                   (0, 1, 1), (0, 0, 1)]  # fmt: skip
        edges: Array = np.array(self.center) + (np.array(corners) - 0.5) * np.array(self.size)
        return edges

    def outline(self, across: int, up: int, plot: int) -> dict[str, Any]:
        """Shape of it in the plane of two axes, in one of several plots."""
        (x0, x1), (y0, y1) = self.walls(across), self.walls(up)
        return {
            "type": "rect", "xref": f"x{plot}", "yref": f"y{plot}",
            "x0": x0, "x1": x1, "y0": y0, "y1": y1, "line": {"color": BOX, "width": 2},
        }  # fmt: skip

    def wall_lines(self, axis: int, suffix: str) -> list[dict[str, Any]]:
        """Shapes of its two walls across an axis, against time."""
        return [
            {
                "type": "line", "xref": "x", "yref": f"y{suffix}", "x0": self.begin_s,
                "x1": self.end_s, "y0": wall, "y1": wall,
                "line": {"color": BOX, "width": 1.5, "dash": "dash"},
            }
            for wall in self.walls(axis)
        ]  # fmt: skip


def boxes_of(context: Context) -> list[Box]:
    """Boxes in the order of time; one per place, size and stretch of time."""
    stamps, start_ns = context.history.stamp_ns, context.bag.start_ns
    states = States(context.history.rows)
    is_on = states.is_fixture_on
    corners = np.concatenate((states.center, states.size, is_on[:, None]), axis=1)
    begins = np.flatnonzero((np.diff(corners, axis=0, prepend=np.nan) != 0.0).any(axis=1))
    ends = np.append(stamps[begins[1:]], context.bag.end_ns)[: len(begins)]
    out = []
    for row, end_ns in zip(begins.tolist(), ends.tolist(), strict=True):
        if is_on[row]:
            begin = max(0.0, (int(stamps[row]) - start_ns) / _SECOND_NS)
            x, y, z, a, b, c = (1e3 * place for place in corners[row, :6].tolist())
            end = (end_ns - start_ns) / _SECOND_NS
            out.append(Box(begin, end, (x, y, z), (a, b, c)))
    return out


def largest(boxes: Sequence[Box]) -> list[Box]:
    """Boxes that were on longest, one per place."""
    lengths: dict[tuple[Any, Any], float] = {}
    one: dict[tuple[Any, Any], Box] = {}
    for box in boxes:
        place = (box.center, box.size)
        lengths[place] = lengths.get(place, 0.0) + box.end_s - box.begin_s
        one[place] = box
    longest = sorted(one, key=lambda place: -lengths[place])[:DRAWN_BOXES]
    return [one[place] for place in longest]
