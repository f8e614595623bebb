"""Reported fixture: a virtual fixture as teleop/state told it, and its shape around the slave."""

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base.errors import TeleopError
from teleop_core.base.parameters import build
from teleop_core.chain.fixtures import FIXTURES, Fixture, shape_of
from teleop_core.chain.fixtures.box import BOX, BoxParameters
from teleop_core.kernels import kernel, raise_pending
from teleop_core.kernels.geometry import Array

KIND = "fixture"
"""Name of the kind in reports; its parameters follow as ``fixture.<parameter>``."""


class UnusableError(Exception):
    """A fixture of a kind that is not installed, or was described in another way."""


@dataclass(frozen=True)
class ReportedFixture:
    """A fixture as a report describes it, wherever it is.

    Attributes:
        kind: Name of its kind.
        values: Names and texts of its parameters, on the master's side.
        size: In place of ``values``: wall to wall on the slave's axes [m], of a recording that is
            older than kinds of fixtures and knows boxes only.
    """

    kind: str
    values: tuple[tuple[str, str], ...] = ()
    size: tuple[float, ...] = ()

    @cached_property
    def fault(self) -> str:
        """Why its shape is not known here; empty if it is."""
        try:
            _ = self._shape
        except UnusableError as error:
            return str(error)
        return ""

    @cached_property
    def _shape(self) -> tuple[Fixture, Any]:
        """Its kind and parameters.

        Raises:
            UnusableError: It has none; the text says why.
        """
        if self.size:
            return BOX, BoxParameters(size=self.size)
        try:
            kind = FIXTURES.find(self.kind)
            values = {name: _value(name, text) for name, text in self.values}
            return kind, build(kind.parameters, values, f"{KIND}.")
        except TeleopError as error:
            raise UnusableError(str(error)) from error

    def outline(self, gain: float, axes: Array) -> Array:
        """Points (N, 3) [m] of a line along its edges, around its middle, in the slave's axes.

        Args:
            gain: Slave motion per master motion.
            axes: Rotation (3, 3) from the master's base to the slave's axes.
        """
        kind, parameters = self._shape
        points = np.asarray(kind.outline(parameters), np.float64)
        if self.size:
            return points
        turned: Array = gain * (points @ axes.T)
        return turned

    def depths(self, offsets: Array, gain: Array, axes: Array) -> Array:
        """Lengths (N,) [m] by which points of the slave are outside; NaN for those without place.

        Args:
            offsets: From its middle to each point, in the slave's axes, shape (N, 3), [m].
            gain: Slave motion per master motion at each, shape (N,).
            axes: Rotation (3, 3) from the master's base to the slave's axes.
        """
        kind, parameters = self._shape
        if self.size:
            gain, axes = np.ones(len(offsets)), np.eye(3)
        lengths = np.empty(len(offsets))
        write_depths(
            kind.depth_pointer, shape_of(parameters), np.ascontiguousarray(axes),
            np.ascontiguousarray(offsets), np.ascontiguousarray(gain), lengths,
        )  # fmt: skip
        raise_pending()
        return lengths


def reported_fixture(values: Mapping[str, str], size: Array) -> ReportedFixture:
    """Fixture of a report.

    Args:
        values: Names and texts of the report.
        size: Extent that the report tells too, on the slave's axes, shape (3,), [m].
    """
    if KIND not in values:
        return ReportedFixture(BOX.name, size=tuple(size.tolist()))
    start = f"{KIND}."
    found = ((n.removeprefix(start), text) for n, text in values.items() if n.startswith(start))
    return ReportedFixture(values[KIND], tuple(found))


def _value(name: str, text: str) -> object:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError) as error:
        reason = f"{KIND}.{name} is {text!r}, must be a number or numbers"
        raise UnusableError(reason) from error


@kernel
def write_depths(
    depth: Any, shape: Array, axes: Array, offsets: Array, gain: Array, lengths: Array
) -> None:
    """Write how far points of the slave are outside of the hand's fixture, scaled (N,) [m].

    The shape is the hand's: a slave's offset is turned and scaled back, and the depth scaled.

    Args:
        depth: Depth of the kind.
        shape: Numbers of its parameters.
        axes: Rotation (3, 3) from the master's base to the slave's axes.
        offsets: From the middle to each point, in the slave's axes, shape (N, 3), [m].
        gain: Slave motion per master motion at each, shape (N,).
        lengths: Written, shape (N,); NaN where offset or gain are none.
    """
    offset, room = np.empty(3), np.empty(3)
    for n in range(lengths.shape[0]):
        total = 0.0
        for i in range(3):
            offset[i] = (
                axes[0, i] * offsets[n, 0] + axes[1, i] * offsets[n, 1] + axes[2, i] * offsets[n, 2]
            )
            offset[i] = offset[i] / gain[n] if gain[n] != 0.0 else np.nan
            total += offset[i]
        is_place = np.isfinite(total)
        lengths[n] = gain[n] * depth(offset, shape, room) if is_place else np.nan
