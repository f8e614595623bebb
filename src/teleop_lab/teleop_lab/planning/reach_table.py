"""Table: the share that a slave can follow, with given and proposed settings, and how to use the proposal."""

import math
import shlex
from collections.abc import Iterator
from typing import TYPE_CHECKING

from teleop_lab.planning.placement import Placement

if TYPE_CHECKING:
    from teleop_lab.planning.reach import Followed, Reach

LABELS = {
    "joint": "a joint is at its limit",
    "workspace": "outside of the workspace",
    "singularity": "too fast near a singularity",
    "speed": "too fast for the joints",
}
"""Causes in words, by the names of :attr:`~teleop_lab.planning.walk.Walked.causes`."""
_WIDTH = 38


def text(reach: "Reach") -> str:
    """Lines for the terminal: a table, and what to do next."""
    path, rate = reach.path, (len(reach.path) - 1) / reach.path.time[-1]
    head = f"{path.name}: {path.time[-1]:.4g} s of motion at {rate:.4g} Hz; {reach.robot.name}"
    columns = [reach.given] if reach.is_given else [reach.given, reach.proposed]
    names = ["as given", "proposed"][: len(columns)]
    lines = [f"{'':{_WIDTH}}" + "".join(f"{name:>12}" for name in names)]
    for label, cells in _rows(columns):
        lines.append(f"{label:{_WIDTH}}" + "".join(f"{cell:>12}" for cell in cells))
    lines += [f"start [rad, m]{'':3}{name}: {_start(c.placement)}" for name, c in zip(names, columns, strict=True)]
    return "\n".join([head, *lines, *_advice(reach)])


def _rows(columns: "list[Followed]") -> Iterator[tuple[str, list[str]]]:
    yield "followed in a session", [_percent(c.share) for c in columns]
    for cause, label in LABELS.items():
        yield f"  not: {label}", [_percent(c.session.causes[cause]) for c in columns]
    yield "in reach where it is, at any speed", [_percent(c.in_place.share) for c in columns]
    placements = [column.placement for column in columns]
    yield "gain, coarse", [f"{p.coarse_gain:.3g}" for p in placements]
    yield "gain, fine", [f"{p.fine_gain:.3g}" for p in placements]
    yield "share of the stylus' turn", [f"{p.rotation_gain:g}" for p in placements]
    yield "slave's x, y, z are the master's", [" ".join(p.axes) for p in placements]
    yield "tool's x, y, z are the stylus'", [" ".join(p.tool_axes) for p in placements]
    yield "then turned about z by", [f"{math.degrees(p.tool_roll):.0f}°" for p in placements]
    yield "tool's turns off the hand's by", [f"{math.degrees(c.misfit):.0f}°" for c in columns]


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _start(placement: Placement) -> str:
    return " ".join(f"{value:.4g}" for value in placement.start)


def _advice(reach: "Reach") -> list[str]:
    if reach.is_given:
        return [f"The parameters as given reach {_percent(reach.goal)}: nothing to change."]
    lines = []
    if reach.proposed.share < reach.goal:
        lines.append(f"No placement was found that reaches {_percent(reach.goal)}; this is the best.")
    gain = reach.given.placement.coarse_gain
    if reach.proposed.placement.coarse_gain < gain:
        share = _percent(reach.proposed.at_given_gain)
        lines.append(f"With gain {gain:g} in place of the proposed one {share} are followed.")
    return [*lines, "--set " + " ".join(shlex.quote(text) for text in reach.texts())]
