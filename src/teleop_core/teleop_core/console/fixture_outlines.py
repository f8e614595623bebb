"""Outlines: virtual fixtures on the page, around the hand and around the slave."""

from functools import cache

import numpy as np
import viser

from teleop_core.base.errors import TeleopError
from teleop_core.chain.fixtures import FIXTURES
from teleop_core.chain.fixtures.box import BOX
from teleop_core.console.look import GOOD, WRONG
from teleop_core.kernels.geometry import Array

_STILL = 5e-5  # [m]


@cache
def unit_outline(kind: str) -> Array:
    """Segments (N, 2, 3) of a kind of fixture along the master's axes, one long along each.

    A kind that is not installed here is drawn as the box around it.
    """
    try:
        fixture = FIXTURES.find(kind)
    except TeleopError:
        fixture = BOX
    parameters = fixture.parameters()
    points = np.asarray(fixture.outline(parameters), np.float64)
    extent = fixture.size(parameters)
    points = points / np.where(extent > 0.0, extent, 1.0)
    pairs = np.stack((points[:-1], points[1:]), axis=1)
    drawn: Array = pairs[np.isfinite(pairs).all(axis=(1, 2))]
    return drawn


class OutlineNode:
    """Outline of a fixture below a node.

    Args:
        server: The page.
        name: Path of its node.
        turn: Quaternion (4,) from the master's axes to those of the node above.
    """

    def __init__(self, server: viser.ViserServer, name: str, turn: Array) -> None:
        self._server, self._name, self._turn = server, name, turn
        self._kind = ""
        self._size = np.ones(3)
        self.line: viser.LineSegmentsHandle | None = None

    def turn(self, turn: Array) -> None:
        """Take another turn (4,) from the master's axes to those of the node above."""
        self._turn = turn
        if self.line is not None:
            self.line.wxyz = turn

    def hide(self) -> None:
        """Draw none."""
        if self.line is not None:
            self.line.visible = False

    def draw(self, kind: str, center: Array, size: Array, *, is_touched: bool) -> None:
        """Draw one.

        Args:
            kind: Its name.
            center: Its middle (3,) [m] in the axes of the node above.
            size: From end to end (3,) [m] along the master's axes.
            is_touched: Whether somebody stands at its wall.
        """
        color = WRONG if is_touched else GOOD
        if self.line is None or kind != self._kind:
            self.line = self._server.scene.add_line_segments(
                self._name, unit_outline(kind).astype(np.float32), color, thickness=2.0,
                thickness_units="screen", wxyz=self._turn, position=center,
                scale=tuple(size.tolist()),
            )  # fmt: skip
            self._kind, self._size = kind, size
        if np.abs(self.line.position - center).max() > _STILL:
            self.line.position = center
        if np.abs(self._size - size).max() > _STILL:
            self._size = size
            self.line.scale = tuple(size.tolist())
        self.line.colors = np.array(color, np.uint8)
        self.line.visible = True
