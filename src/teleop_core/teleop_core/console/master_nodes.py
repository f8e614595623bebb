"""Master nodes: the device with its stylus on the page, the fixture around the hand, the force."""

import numpy as np
import viser

from teleop_core.console.arrows import ForceArrow
from teleop_core.console.body_nodes import add_solids
from teleop_core.console.look import HAND
from teleop_core.console.outlines import OutlineNode
from teleop_core.console.poses import move
from teleop_core.console.stand import DEVICE, REST, STYLUS, Stand
from teleop_core.console.tails import Tail
from teleop_core.geometry import Array

_DIM = 0.35  # of the device, behind which the handles of the stylus are seen


class MasterNodes:
    """Device of an arm, below a node in master_base.

    Args:
        server: The page.
        path: Path of that node.
        stand: Where it stands.
    """

    def __init__(self, server: viser.ViserServer, path: str, stand: Stand) -> None:
        self.path = path
        self.base = server.scene.add_frame(
            path, show_axes=False, axes_length=0.05, axes_radius=0.002, wxyz=stand.quaternion,
            position=stand.origin,
        )  # fmt: skip
        add_solids(server, path, DEVICE, opacity=_DIM)
        self.stylus = server.scene.add_frame(
            f"{path}/stylus", show_axes=False, axes_length=0.04, axes_radius=0.0015,
            wxyz=REST[3:], position=REST[:3],
        )  # fmt: skip
        add_solids(server, f"{path}/stylus", STYLUS)
        self.outline = OutlineNode(server, f"{path}/fixture", np.array([1.0, 0.0, 0.0, 0.0]))
        self.tail = Tail(server, f"{path}/path", HAND, 1.5)
        self._force = ForceArrow(server, f"{path}/force")

    def stand(self, stand: Stand) -> None:
        """Stand elsewhere."""
        self.base.wxyz, self.base.position = stand.quaternion, stand.origin

    def draw(self, time: float, pose: Array | None, force: Array | None) -> float:
        """Draw stylus, its path and the force on it; returns the size of the force [N].

        Args:
            time: Of the session [s].
            pose: Of the stylus in master_base (7,); None where it is unknown.
            force: Force on the stylus (3,) [N]; None where it is unknown.
        """
        if pose is None:
            return 0.0
        move(self.stylus, pose)
        self.tail.draw(time, pose[:3])
        return 0.0 if force is None else self._force.draw(pose[:3], force)

    def show_axes(self, *, is_shown: bool) -> None:
        """Show the axes of the device's base and of the stylus, or hide them."""
        self.base.show_axes = self.stylus.show_axes = is_shown
