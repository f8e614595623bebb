"""Outlines: virtual fixtures on the page, around the hand and around the slave."""

from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import viser

from teleop_console.link import Setting
from teleop_console.look import GOOD, WRONG
from teleop_core.base.parameters import build
from teleop_core.coupling.fixtures import Fixture
from teleop_core.kernels.geometry import Array
from teleop_core.shapes import SHAPES
from teleop_core.shapes.basis.drawing import segments_of
from teleop_core.shapes.box import BOX

_STILL = 5e-5  # [m]
_FLAT = 1e-9  # [m]


@dataclass(frozen=True)
class Look:
    """Kind and parameters of a fixture, without its position.

    Attributes:
        kind: Name of its kind.
        values: Names and values of the parameters of the fixture's shape and place; missing parameters have their
            defaults.
    """

    kind: str = BOX.name
    values: tuple[tuple[str, Setting], ...] = ()


@lru_cache(maxsize=64)
def unit_outline(look: Look) -> Array:
    """Segments (N, 2, 3) of a fixture along the master's axes, scaled to length 1 along each axis.

    Along an axis on which the fixture has no extent, the segments are in metres. A fixture of an unknown kind is drawn
    as its bounding box.
    """
    fixture = Fixture(BOX, BOX.parameters())
    with suppress(Exception):  # a user's own kind may raise any error, which must not stop the page
        values: dict[str, Any] = dict(look.values)
        place, shape = values.pop("place", fixture.place), SHAPES.find(look.kind)
        found = Fixture(shape, build(shape.parameters, values), tuple(place))
        found.size()
        fixture = found
    extent = fixture.size()
    return segments_of(fixture.outline() / np.where(extent > _FLAT, extent, 1.0))


def scale_of(outline: Array, size: Array, gain: float) -> Array:
    """Scale (3,) with which a unit outline has the size (3,) [m]; along flat axes the outline is already in metres."""
    is_flat = np.ptp(outline.reshape(-1, 3), axis=0) < 0.5
    scale: Array = np.where(is_flat, gain, size)
    return scale


class OutlineNode:
    """Outline of a fixture below a node.

    Args:
        server: The page.
        name: Path of the outline's node.
        turn: Quaternion (4,) from the master's axes to the axes of the parent node.
    """

    def __init__(self, server: viser.ViserServer, name: str, turn: Array) -> None:
        self._server, self._name, self._turn = server, name, turn
        self._look = Look()
        self._scale = np.ones(3)
        self.line: viser.LineSegmentsHandle | None = None

    def turn(self, turn: Array) -> None:
        """Set the rotation (4,) from the master's axes to the axes of the parent node."""
        self._turn = turn
        if self.line is not None:
            self.line.wxyz = turn

    def hide(self) -> None:
        """Hide the outline."""
        if self.line is not None:
            self.line.visible = False

    def draw(self, look: Look, center: Array, scale: Array, *, is_touched: bool) -> None:
        """Draw one outline.

        Args:
            look: Kind of fixture that is drawn.
            center: Centre of the fixture (3,) [m] in the axes of the parent node.
            scale: Scale factors of the unit outline (3,), along the master's axes.
            is_touched: Whether the hand or the slave touches the fixture's wall.
        """
        color = WRONG if is_touched else GOOD
        if self.line is None or look != self._look:
            self.line = self._server.scene.add_line_segments(
                self._name,
                unit_outline(look).astype(np.float32),
                color,
                thickness=2.0,
                thickness_units="screen",
                wxyz=self._turn,
                position=center,
                scale=tuple(scale.tolist()),
            )
            self._look, self._scale = look, scale
        if np.abs(self.line.position - center).max() > _STILL:
            self.line.position = center
        if np.abs(self._scale - scale).max() > _STILL:
            self._scale = scale
            self.line.scale = tuple(scale.tolist())
        self.line.colors = np.array(color, np.uint8)
        self.line.visible = True
