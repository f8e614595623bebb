"""Master nodes: the device with its stylus, the fixture around the hand, and the force, as the page shows them."""

import numpy as np
import viser

from teleop_console.body_nodes import add_solids
from teleop_console.fixture_outlines import OutlineNode
from teleop_console.look import FORCE, HAND
from teleop_console.poses import move
from teleop_console.stand import DEVICE, REST, STYLUS, Stand
from teleop_console.tails import Tail
from teleop_core.kernels.geometry import Array

METRES_PER_NEWTON = 0.05
"""Length of a force's arrow [m/N]."""
_LEAST = 0.03
"""Smallest force that is drawn [N]; the device's forces have steps of some millinewtons."""
_STEP = 0.02  # change below which the arrow is not redrawn [N]


class ForceArrow:
    """Arrow of a force at a point, in the axes of the parent node.

    Args:
        server: The page.
        name: Path of the arrow's node.
    """

    def __init__(self, server: viser.ViserServer, name: str) -> None:
        self._frame = server.scene.add_frame(name, show_axes=False, visible=False)
        self._arrow = server.scene.add_arrows(
            f"{name}/arrow",
            np.zeros((1, 2, 3), np.float32),
            FORCE,
            shaft_radius=0.0025,
            head_radius=0.006,
            head_length=0.014,
        )
        self._label = server.scene.add_label(f"{name}/value", "0.0 N", font_screen_scale=0.9, anchor="bottom-left")
        self._drawn = np.zeros(3)

    def draw(self, place: Array, force: Array) -> float:
        """Draw a force (3,) [N] at a point (3,) [m]; returns the magnitude of the force [N]."""
        size = float(np.linalg.norm(force))
        if not size >= _LEAST:  # NaN too
            self._frame.visible = False
            return 0.0
        self._frame.position = place
        if np.abs(force - self._drawn).max() > _STEP:
            tip = METRES_PER_NEWTON * force
            self._arrow.points = np.stack((np.zeros(3), tip))[None].astype(np.float32)
            self._label.position = tip
            self._label.text = f"{size:.1f} N"
            self._drawn = force.copy()
        self._frame.visible = True
        return size


_DIM = 0.35  # opacity of the device, so that the stylus's handles behind it are visible


class MasterNodes:
    """Device of an arm, below a node in master_base.

    Args:
        server: The page.
        path: Path of the node in master_base.
        stand: Position and rotation of the device on the page.
    """

    def __init__(self, server: viser.ViserServer, path: str, stand: Stand) -> None:
        self.path = path
        self.base = server.scene.add_frame(
            path, show_axes=False, axes_length=0.05, axes_radius=0.002, wxyz=stand.quaternion, position=stand.origin
        )
        add_solids(server, path, DEVICE, opacity=_DIM)
        self.stylus = server.scene.add_frame(
            f"{path}/stylus", show_axes=False, axes_length=0.04, axes_radius=0.0015, wxyz=REST[3:], position=REST[:3]
        )
        add_solids(server, f"{path}/stylus", STYLUS)
        self.outline = OutlineNode(server, f"{path}/fixture", np.array([1.0, 0.0, 0.0, 0.0]))
        self.tail = Tail(server, f"{path}/path", HAND, 1.5)
        self._force = ForceArrow(server, f"{path}/force")

    def stand(self, stand: Stand) -> None:
        """Move the device to another stand."""
        self.base.wxyz, self.base.position = stand.quaternion, stand.origin

    def draw(self, time: float, pose: Array | None, force: Array | None) -> float:
        """Draw the stylus, its path and the force on it; returns the magnitude of the force [N].

        Args:
            time: Time of the session [s].
            pose: Pose of the stylus in master_base (7,); None if unknown.
            force: Force on the stylus (3,) [N]; None if unknown.
        """
        if pose is None:
            return 0.0
        move(self.stylus, pose)
        self.tail.draw(time, pose[:3])
        return 0.0 if force is None else self._force.draw(pose[:3], force)

    def show_axes(self, *, is_shown: bool) -> None:
        """Show the axes of the device's base and of the stylus, or hide them."""
        self.base.show_axes = self.stylus.show_axes = is_shown
