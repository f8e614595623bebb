"""Jaw nodes: the two fingers at the slave's tip on the page, the objects, and their pegs."""

from collections.abc import Mapping

import numpy as np
import viser

from teleop_console.link import ArmView, Setting
from teleop_console.look import ROLES, TARGET
from teleop_console.poses import move
from teleop_core.graph.topics import SLAVE_JAW_BOARD, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_OBJECT_CP
from teleop_core.kernels.geometry import Array, quaternion_products, rotations_from_quaternions
from teleop_core.slave.jaw.jaw import JawParameters

_THICK = 0.1  # thickness of a finger divided by its length
_PEG = 0.2  # thickness of a peg divided by that of an object
_FIRST = SLAVE_JAW_BOARD.columns.index("x0")  # first column of the positions of objects
_DRAWN = ("finger_length", "object.size", "object.place", "pegs.place", "pegs.height")


def finger_poses(tip: Array, angle: float, length: float) -> Array:
    """Poses (2, 7) of the centres of both fingers; their z axes point from the pivot to the pads.

    The pads are at the tip. The pivot lies behind the tip along the tip's z axis, and the fingers rotate about the
    tip's y axis.

    Args:
        tip: Pose (7,) of the tip.
        angle: Angle between the fingers [rad].
        length: Length of a finger [m].
    """
    half, turn = 0.5 * angle, rotations_from_quaternions(tip[None, 3:])[0]
    pivot = tip[:3] - length * np.cos(half) * turn[:, 2]
    poses = np.empty((2, 7))
    for row, side in zip(poses, (-1.0, 1.0), strict=True):
        sine, cosine = np.sin(side * half), np.cos(half)
        row[:3] = pivot + 0.5 * length * (sine * turn[:, 0] + cosine * turn[:, 2])
        own = np.array([[np.cos(0.5 * side * half), 0.0, np.sin(0.5 * side * half), 0.0]])
        row[3:] = quaternion_products(tip[None, 3:], own)[0]
    return poses


class JawNodes:
    """Fingers, objects and pegs of one arm, below a node in slave_base; an arm without a jaw has none.

    Args:
        server: The page.
        path: Path of the node in slave_base.
        has_fingers: Whether the robot's file has fingers, so that none are added.

    Attributes:
        opening: Share of the jaw's largest angle, 0 (closed) to 1; None before the jaw has reported an angle.
    """

    def __init__(self, server: viser.ViserServer, path: str, *, has_fingers: bool = False) -> None:
        self._server, self._path, self._has_fingers = server, path, has_fingers
        self.opening: float | None = None
        self._upper = JawParameters.upper
        self._values: dict[str, Setting] = {}
        self._length = self._size = 0.0
        self.fingers: list[viser.BoxHandle] = []
        self.blocks: list[viser.BoxHandle] = []
        self.pegs: list[viser.BoxHandle] = []

    def retune(self, values: Mapping[str, Setting], upper: Setting | None = None) -> None:
        """Set the sizes from parameters of the jaw.

        Args:
            values: Parameters by their names in the group ``jaw_sim``; empty for a session without this group.
            upper: Largest angle of the jaw's server [rad]; None if it is unknown.
        """
        self._upper = upper if isinstance(upper, float) and upper > 0.0 else JawParameters.upper
        values = {name: values[name] for name in _DRAWN if name in values}
        if values == self._values:
            return
        self._values = values
        for node in (*self.fingers, *self.blocks, *self.pegs):
            node.remove()
        self._length, self._size = (
            float(one) if isinstance(one := values.get(name), float) else 0.0
            for name in ("finger_length", "object.size")
        )
        self.fingers, self.blocks = [], []
        thick, (middles, height) = _PEG * self._size, _pegs(values, self._size)
        self.pegs = []
        for middle in middles:
            self._add(self.pegs, "peg", (thick, thick, height))
            self.pegs[-1].position = middle

    def draw(self, tip: Array, view: ArmView) -> None:
        """Draw the fingers at a tip (7,), and the objects at their reported poses."""
        state, place = view.get(SLAVE_JAW_MEASURED_JS), view.get(SLAVE_JAW_OBJECT_CP)
        if state is not None and np.isfinite(state[0]):
            self.opening = float(state[0]) / self._upper
        if state is not None and self._length > 0.0 and not self._has_fingers:
            thick = _THICK * self._length
            while len(self.fingers) < 2:
                self._add(self.fingers, "finger", (thick, 2.0 * thick, self._length))
            poses = finger_poses(tip, state[0], self._length)
            for node, pose in zip(self.fingers, poses, strict=True):
                move(node, pose)
        if place is not None and self._size > 0.0 and place[:3].any():  # a zero position means that there is no object
            poses = _block_poses(place, view.get(SLAVE_JAW_BOARD))
            while len(self.blocks) < len(poses):
                self._add(self.blocks, "object", (self._size,) * 3)
            for node, pose in zip(self.blocks, poses, strict=True):
                move(node, pose)

    def _add(self, nodes: list[viser.BoxHandle], name: str, size: tuple[float, float, float]) -> None:
        color = TARGET if name == "object" else ROLES["tool"]
        path = f"{self._path}/{name}{len(nodes)}"
        nodes.append(self._server.scene.add_box(path, color=color, dimensions=size))


def _block_poses(place: Array, board: Array | None) -> Array:
    """Poses (N, 7) of all blocks; blocks at rest are upright.

    Args:
        place: Pose (7,) of the block that moved last.
        board: Columns of ``slave/jaw/board``, if this topic exists.
    """
    middles = np.empty((0, 3)) if board is None else board[_FIRST:].reshape(-1, 3)
    middles = middles[middles.any(axis=1)]  # a zero position means that there is no block
    if not len(middles):
        return place[None]
    poses = np.hstack((middles, np.tile([1.0, 0.0, 0.0, 0.0], (len(middles), 1))))
    poses[np.square(middles - place[:3]).sum(axis=1).argmin()] = place
    return poses


def _pegs(values: Mapping[str, Setting], size: float) -> tuple[Array, float]:
    """Centres (N, 3) of the pegs, and height of the pegs [m]."""
    objects, axes = (
        np.array(value if isinstance(value := values.get(name), tuple) else (), dtype=np.float64)
        for name in ("object.place", "pegs.place")
    )
    height = values.get("pegs.height")
    if not len(objects) or not isinstance(height, float):
        return np.empty((0, 3)), 0.0
    middles = np.insert(axes.reshape(-1, 2), 2, objects[2] + 0.5 * (height - size), axis=1)
    return middles, height
