"""Drawn state of an arm: fixture, force on the hand, paths of command and tip, as markers."""

from collections import deque
from collections.abc import Mapping

import numpy as np

from teleop_core.bags.markers import Color, Marker, Shape
from teleop_core.chain.fixtures.sphere import SPHERE
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.portable import length
from teleop_core.session.model import MASTER, SLAVE

TAIL = 200
"""Points of a path."""
FORCE_SCALE = 0.02
"""Length of the arrow of a force [m/N]."""
_TOUCH = 0.05  # force of a wall that somebody touches [N]
_FREE: Color = (0.26, 0.52, 0.96, 0.25)
_TOUCHED: Color = (0.90, 0.20, 0.15, 0.40)
_FORCE: Color = (0.90, 0.45, 0.10, 1.0)
_MEASURED: Color = (0.76, 0.22, 0.04, 1.0)
_COMMANDED: Color = (0.26, 0.52, 0.96, 1.0)


class ArmMarkers:
    """Markers of one arm, which remembers the ends of its paths.

    Args:
        arm: Its namespace; empty for that of plain topics.
    """

    def __init__(self, arm: str = "") -> None:
        prefix = f"{arm}/" if arm else ""
        self._slave, self._master = f"{prefix}{SLAVE}base", f"{prefix}{MASTER}base"
        self._tails = {name: deque[Array](maxlen=TAIL) for name in ("measured", "commanded")}

    def forget(self) -> None:
        """Let the paths begin anew."""
        for tail in self._tails.values():
            tail.clear()

    def fixture(self, state: Mapping[str, float], kind: str, force: float = 0.0) -> Marker:
        """Virtual fixture, red while it is touched; taken away when it is off.

        Args:
            state: Numbers of ``teleop/state`` by name; empty before the first.
            kind: Name of the kind of fixture: a sphere is one, others are the box around them.
            force: Size of the force on the hand [N].
        """
        is_on, pose = bool(state.get("is_fixture_on")), np.array([0.0, 0, 0, 1, 0, 0, 0])
        if not is_on:
            return Marker("fixture", self._master, Shape.CUBE, is_shown=False)
        pose[:3] = [state[f"fixture_center_{axis}"] for axis in "xyz"]
        x, y, z = (state[f"fixture_size_{axis}"] for axis in "xyz")
        shape = Shape.SPHERE if kind == SPHERE.name else Shape.CUBE
        color = _TOUCHED if force > _TOUCH else _FREE
        return Marker("fixture", self._master, shape, pose, (x, y, z), color)

    def force(self, stylus: Array, force: Array) -> Marker:
        """Force (3,) [N] on the hand at a stylus (7,), in master_base; no arrow for none."""
        ends = np.stack((stylus[:3], stylus[:3] + FORCE_SCALE * force))
        is_shown = float(length(force)) > _TOUCH
        scale = (0.004, 0.009, 0.01)
        return Marker("force", self._master, Shape.ARROW, scale=scale, color=_FORCE,
                      points=ends, is_shown=is_shown)  # fmt: skip

    def path(self, name: str, point: Array) -> Marker:
        """Path of the tip, ``measured`` or ``commanded``, longer by a point (3,) [m]."""
        tail = self._tails[name]
        tail.append(point.copy())
        color, width = (_MEASURED, 0.002) if name == "measured" else (_COMMANDED, 0.001)
        return Marker(name, self._slave, Shape.LINE_STRIP, scale=(width, 0.0, 0.0), color=color,
                      points=np.array(tail), is_shown=len(tail) > 1)  # fmt: skip
