"""Reach result: the shares that a slave can follow with given and with proposed settings."""

import math
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

from teleop_core.robots.robot import Robot
from teleop_lab.planning.asked import AskedPath
from teleop_lab.planning.placement import Placement
from teleop_lab.planning.walk import Walked

LABELS = {
    "joint": "a joint is at its limit",
    "workspace": "outside of the workspace",
    "singularity": "too fast near a singularity",
    "speed": "too fast for the joints",
}
"""Causes in words, by the names of :attr:`~teleop_lab.planning.walk.Walked.causes`."""
_WIDTH = 38
_NOTICED = 15.0  # angle between the axes of hand and tool that a person notices [deg]; assumed


@dataclass(frozen=True, eq=False)
class Followed:
    """A placement, and how the slave follows the path with it.

    Attributes:
        placement: Start, turn and gains.
        session: Walk with the limits of a session: they cut the hand's motion, and the joint speeds are limited.
        in_place: Walk along the original path: no motion is cut off, and joint speeds are not limited.
        at_given_gain: Share of the time in which a session would follow with the given gains.
        misfit: Angle [rad] between the rotation axes of the tool and those of the hand.
    """

    placement: Placement
    session: Walked
    in_place: Walked
    at_given_gain: float
    misfit: float

    @property
    def share(self) -> float:
        """Share of the time in which a session would follow."""
        return self.session.share


@dataclass(frozen=True, eq=False)
class Reach:
    """Share of a motion that a slave can follow.

    Attributes:
        path: Motion of the hand.
        robot: The slave.
        goal: Share of the time in which the slave must follow.
        given: Result with the given parameters.
        proposed: Result with the best placement; equal to ``given`` if ``given`` reaches the goal.
        arm: Namespace of the arm; empty for the default arm.
    """

    path: AskedPath
    robot: Robot
    goal: float
    given: Followed
    proposed: Followed
    arm: str = ""

    @property
    def is_given(self) -> bool:
        """Whether the given parameters reach the goal, so that no change is needed."""
        return self.given.placement == self.proposed.placement

    def settings(self) -> dict[str, float | str | list[float] | list[str]]:
        """Proposed parameters for ``tc.replay(..., settings=...)``."""
        return self.proposed.placement.settings(self.arm)

    def texts(self) -> list[str]:
        """Proposed parameters as ``key=value`` for ``--set``."""
        return self.proposed.placement.texts(self.arm)

    def parameter_file(self) -> str:
        """Proposed parameters as a ROS 2 parameter file for ``--config``."""
        return self.proposed.placement.parameter_file(self.arm)

    def __str__(self) -> str:
        """Text for the terminal: a table, and the next command to run."""
        path, rate = self.path, (len(self.path) - 1) / self.path.time[-1]
        head = f"{path.name}: {path.time[-1]:.4g} s of motion at {rate:.4g} Hz; {self.robot.name}"
        columns = [self.given] if self.is_given else [self.given, self.proposed]
        names = ["as given", "proposed"][: len(columns)]
        lines = [f"{'':{_WIDTH}}" + "".join(f"{name:>12}" for name in names)]
        for label, cells in _rows(columns):
            lines.append(f"{label:{_WIDTH}}" + "".join(f"{cell:>12}" for cell in cells))
        lines += [f"start [rad, m]{'':3}{name}: {_start(c.placement)}" for name, c in zip(names, columns, strict=True)]
        return "\n".join([head, *lines, *_advice(self)])

    def __repr__(self) -> str:
        shares = f"{self.given.share:.1%} as given, {self.proposed.share:.1%} proposed"
        return f"Reach({self.path.name}, {self.robot.name}: {shares})"


def _rows(columns: list[Followed]) -> Iterator[tuple[str, list[str]]]:
    yield "followed in a session", [_percent(c.share) for c in columns]
    for cause, label in LABELS.items():
        yield f"  not: {label}", [_percent(c.session.causes[cause]) for c in columns]
    yield "in reach where it is, at any speed", [_percent(c.in_place.share) for c in columns]
    placements = [column.placement for column in columns]
    yield "gain, coarse", [f"{p.coarse_gain:.3g}" for p in placements]
    yield "gain, fine", [f"{p.fine_gain:.3g}" for p in placements]
    yield "share of the stylus' turn", [f"{p.rotation_gain:g}" for p in placements]
    yield "slave's x, y, z are the master's", [" ".join(p.axes) for p in placements]
    if any(p.tool_axes for p in placements):
        yield "tool's x, y, z are the stylus'", [" ".join(p.tool_axes) for p in placements]
        yield "then turned about z by", [f"{math.degrees(p.tool_roll):.0f}°" for p in placements]
    yield "tool's turns off the hand's by", [f"{math.degrees(c.misfit):.0f}°" for c in columns]


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _start(placement: Placement) -> str:
    return " ".join(f"{value:.4g}" for value in placement.start)


def _advice(reach: Reach) -> list[str]:
    lines = []
    if (off := math.degrees(reach.proposed.misfit)) > _NOTICED:
        lines.append(
            f"The tool turns about axes {off:.0f}° away from those of the hand: --set motion_scaling.tool_axes=[] "
            "turns it about the axes of the hand."
        )
    if reach.is_given:
        parameters = "The parameters as given reach" if not lines else "All else as given reaches"
        return [*lines, f"{parameters} {_percent(reach.goal)}: nothing to change."]
    if reach.proposed.share < reach.goal:
        lines.append(f"No placement was found that reaches {_percent(reach.goal)}; this is the best.")
    gain = reach.given.placement.coarse_gain
    if reach.proposed.placement.coarse_gain < gain:
        share = _percent(reach.proposed.at_given_gain)
        lines.append(f"With gain {gain:g} in place of the proposed one {share} are followed.")
    return [*lines, "--set " + " ".join(shlex.quote(text) for text in reach.texts())]
