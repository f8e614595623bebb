"""Arrows: forces on the page, with a scale and their value."""

import numpy as np
import viser

from teleop_core.console.look import WRONG
from teleop_core.geometry import Array

METRES_PER_NEWTON = 0.05
"""Scale of forces."""
_LEAST = 0.03
"""Force that is not drawn [N]; forces of the device are read in steps of some mN."""
_STEP = 0.02  # change that is not drawn [N]


class ForceArrow:
    """Force at a place, in the axes of the node above.

    Args:
        server: The page.
        name: Path of its node.
    """

    def __init__(self, server: viser.ViserServer, name: str) -> None:
        self._frame = server.scene.add_frame(name, show_axes=False, visible=False)
        self._arrow = server.scene.add_arrows(
            f"{name}/arrow", np.zeros((1, 2, 3), np.float32), WRONG, shaft_radius=0.0025,
            head_radius=0.006, head_length=0.014,
        )  # fmt: skip
        self._label = server.scene.add_label(
            f"{name}/value", "0.0 N", font_screen_scale=0.9, anchor="bottom-left"
        )
        self._drawn = np.zeros(3)

    def draw(self, place: Array, force: Array) -> float:
        """Draw a force (3,) [N] at a place (3,) [m]; returns its size [N]."""
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
