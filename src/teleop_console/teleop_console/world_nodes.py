"""World nodes: the object that the slave's tip touches, and the force of the object, as the page shows them."""

from collections.abc import Mapping
from contextlib import suppress

import numpy as np
import viser

from teleop_console.link import Setting
from teleop_console.look import TARGET
from teleop_console.master_nodes import ForceArrow
from teleop_core.base.parameters import build
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot
from teleop_core.shapes.basis.drawing import segments_of
from teleop_core.slave.world import WORLD_OBJECTS
from teleop_core.slave.world.contents import WorldParameters


def object_outline(values: Mapping[str, Setting], robot: Robot) -> Array:
    """Segments (N, 2, 3) [m] of the object in the slave's base; empty if the object is unknown.

    Args:
        values: Parameters of the world, by their names without the prefix.
        robot: The slave; an object without ``place`` lies below the slave's start.
    """
    nothing, kind = np.empty((0, 2, 3)), values.get("kind", "empty")
    of_object = ("tool_", f"{kind}.")
    own = {
        name: value for name, value in values.items() if name in {"kind", "place", "gap"} or name.startswith(of_object)
    }
    with suppress(Exception):  # a user's own kind may raise any error, which must not stop the page
        world = build(WorldParameters, own)
        if world.kind.kind == "empty":
            return nothing
        center = world.center(robot.fk(robot.start))
        part = WORLD_OBJECTS.find(world.kind.kind)
        return segments_of(np.asarray(part.outline(world.kind.parameters), np.float64) + center)
    return nothing


class WorldNodes:
    """Object of one arm and its force on the tip, below a node in slave_base.

    Args:
        server: The page.
        path: Path of the node in slave_base.
        robot: The slave.
    """

    def __init__(self, server: viser.ViserServer, path: str, robot: Robot) -> None:
        self._server, self._path, self._robot = server, path, robot
        self._values: Mapping[str, Setting] = {}
        self.line: viser.LineSegmentsHandle | None = None
        self._corners = np.empty((0, 3))
        self.push = ForceArrow(server, f"{path}/push")

    def retune(self, values: Mapping[str, Setting]) -> None:
        """Draw the object that the parameters define; it replaces the previous object."""
        if values == self._values:
            return
        self._values = dict(values)
        if self.line is not None:
            self.line.remove()
            self.line = None
        outline = object_outline(values, self._robot)
        points = outline.reshape(-1, 3)
        self._corners = np.array((points.min(axis=0), points.max(axis=0))) if len(points) else points
        if len(outline):
            self.line = self._server.scene.add_line_segments(
                f"{self._path}/world", outline.astype(np.float32), TARGET, thickness=2.0, thickness_units="screen"
            )

    def points(self) -> Array:
        """Lowest and highest corner (2, 3) [m] of the object in slave_base; (0, 3) without an object."""
        return self._corners

    def draw(self, tip: Array, force: Array | None) -> None:
        """Draw the object's force (3,) [N] on a tip at (3,) [m]; an argument is None if it is unknown."""
        self.push.draw(tip, np.zeros(3) if force is None else force)
