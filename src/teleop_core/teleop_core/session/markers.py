"""Drawn state of an arm: fixture, force on the hand, paths of command and tip, as markers."""

from collections import deque
from collections.abc import Mapping

import numpy as np

from teleop_core.bags.markers import Color, Marker, MarkerShape
from teleop_core.coupling.fixtures.reported_fixture import ReportedFixture, reported_fixture
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.kernels import Array, length
from teleop_core.kernels.axes import axis_map
from teleop_core.session.model import MASTER, SLAVE
from teleop_core.shapes import box, sphere
from teleop_core.shapes.basis.drawing import segments_of

TAIL = 200
"""Largest number of points of a drawn path."""
FORCE_SCALE = 0.02
"""Length of the arrow of a force [m/N]."""
_TOUCH = 0.05  # smallest force at which a wall counts as touched [N]
_FREE: Color = (0.26, 0.52, 0.96, 0.25)
_TOUCHED: Color = (0.90, 0.20, 0.15, 0.40)
_WIDTH = 0.001  # width of a fixture's lines [m]
_BODIES = {box.BOX.name: MarkerShape.CUBE, sphere.SPHERE.name: MarkerShape.SPHERE}
_FORCE: Color = (0.90, 0.45, 0.10, 1.0)
_MEASURED: Color = (0.76, 0.22, 0.04, 1.0)
_COMMANDED: Color = (0.26, 0.52, 0.96, 1.0)


class ArmMarkers:
    """Markers of one arm. This class stores the latest points of the arm's paths.

    Args:
        arm: Namespace of the arm; empty for the arm whose topics have no prefix.
        axes: Rotation (3, 3) from the master's base to the slave's axes; None for the rotation of the default
            parameters.
    """

    def __init__(self, arm: str = "", axes: Array | None = None) -> None:
        prefix = f"{arm}/" if arm else ""
        self._slave, self._master = f"{prefix}{SLAVE}base", f"{prefix}{MASTER}base"
        published = MotionScalingParameters().axes
        self._axes = axis_map("axes", published) if axes is None else axes
        self._told: tuple[ReportedFixture, float] | None = None
        self._segments = np.zeros((0, 3))
        self._tails = {name: deque[Array](maxlen=TAIL) for name in ("measured", "commanded")}

    def forget(self) -> None:
        """Delete the stored points, so that new paths begin."""
        for tail in self._tails.values():
            tail.clear()

    def fixture(self, state: Mapping[str, float], told: Mapping[str, str], force: float = 0.0) -> Marker:
        """Virtual fixture around the slave, red while it is touched, and removed while it is off.

        Boxes and spheres are drawn as solids, other shapes as lines along their edges. An unknown shape is drawn as
        its bounding box.

        Args:
            state: Numbers of ``teleop/state`` by name; empty before the first message.
            told: Names and texts of the same report, which describe the fixture.
            force: Size of the force on the hand [N].
        """
        is_on, pose = bool(state.get("is_fixture_on")), np.array([0.0, 0, 0, 1, 0, 0, 0])
        if not is_on:
            return Marker("fixture", self._slave, MarkerShape.CUBE, is_shown=False)
        pose[:3] = [state[f"fixture_center_{axis}"] for axis in "xyz"]
        x, y, z = (state[f"fixture_size_{axis}"] for axis in "xyz")
        color = _TOUCHED if force > _TOUCH else _FREE
        fixture = reported_fixture(told, np.array((x, y, z)))
        if fixture.kind in _BODIES or fixture.fault:
            shape = _BODIES.get(fixture.kind, MarkerShape.CUBE)
            return Marker("fixture", self._slave, shape, pose, (x, y, z), color)
        return Marker("fixture", self._slave, MarkerShape.LINE_LIST, pose, (_WIDTH, 0.0, 0.0),
                      (*color[:3], 1.0), self._edges(fixture, state["gain"]))  # fmt: skip

    def _edges(self, fixture: ReportedFixture, gain: float) -> Array:
        """End points (N, 3) [m] of segments along the fixture's edges, two for each segment.

        The points are computed only when the fixture or the gain changes.
        """
        if self._told != (fixture, gain):
            self._segments = segments_of(fixture.outline(gain, self._axes)).reshape(-1, 3)
            self._told = fixture, gain
        return self._segments

    def force(self, stylus: Array, force: Array) -> Marker:
        """Arrow of the force (3,) [N] on the hand at a stylus pose (7,), in master_base.

        The arrow is hidden if the force is near zero.
        """
        ends = np.stack((stylus[:3], stylus[:3] + FORCE_SCALE * force))
        is_shown = float(length(force)) > _TOUCH
        scale = (0.004, 0.009, 0.01)
        return Marker(
            "force", self._master, MarkerShape.ARROW, scale=scale, color=_FORCE, points=ends, is_shown=is_shown
        )

    def path(self, name: str, point: Array) -> Marker:
        """Append a point (3,) [m] to the tip's path ``measured`` or ``commanded``, and return the path's marker."""
        tail = self._tails[name]
        tail.append(point.copy())
        color, width = (_MEASURED, 0.002) if name == "measured" else (_COMMANDED, 0.001)
        return Marker(name, self._slave, MarkerShape.LINE_STRIP, scale=(width, 0.0, 0.0), color=color,
                      points=np.array(tail), is_shown=len(tail) > 1)  # fmt: skip
