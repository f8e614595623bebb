"""Jaw nodes: the two fingers at the slave's tip on the page, the objects, and their pegs."""

from collections.abc import Mapping

import numpy as np
import viser

from teleop_core.console.body_nodes import ROLES
from teleop_core.console.link import ArmView, Setting
from teleop_core.console.look import TARGET
from teleop_core.console.poses import move
from teleop_core.graph.topics import (
    SLAVE_JAW_BOARD,
    SLAVE_JAW_MEASURED_JS,
    SLAVE_JAW_OBJECT_CP,
)
from teleop_core.kernels.geometry import Array, quaternion_products, rotations_from_quaternions

_THICK = 0.1  # of a finger, over its length
_PEG = 0.2  # thickness of a peg, over that of an object
_FIRST = 3  # column of slave/jaw/board, of the first object's x


def finger_poses(tip: Array, angle: float, length: float) -> Array:
    """Poses (2, 7) of the middles of both fingers, whose z axes lead from the pivot to the pads.

    The pads are at the tip, the pivot lies behind it along the tip's z axis, and the fingers turn
    about the tip's y axis.

    Args:
        tip: Pose (7,) of the tip.
        angle: Between the fingers [rad].
        length: Of a finger [m].
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
    """Fingers, objects and pegs of one arm, below a node in slave_base; nothing without a jaw.

    Args:
        server: The page.
        path: Path of that node.
    """

    def __init__(self, server: viser.ViserServer, path: str) -> None:
        self._server, self._path = server, path
        self._length, self._size = 0.0, 0.0
        self.fingers: list[viser.BoxHandle] = []
        self.block: viser.BoxHandle | None = None
        self.blocks: dict[int, viser.BoxHandle] = {}
        self.pegs: list[viser.BoxHandle] = []

    def retune(self, values: Mapping[str, Setting]) -> None:
        """Take the sizes that these parameters of the jaw say.

        Args:
            values: By their names in the group ``jaw_sim``; none of a session without.
        """
        length, size = values.get("finger_length"), values.get("object.size")
        sizes = tuple(float(one) if isinstance(one, float) else 0.0 for one in (length, size))
        if sizes == (self._length, self._size):
            return
        blocks = [self.block] if self.block is not None else []
        for node in (*self.fingers, *blocks, *self.blocks.values(), *self.pegs):
            node.remove()
        self._length, self._size = sizes
        self.fingers, self.block, self.blocks = [], None, {}
        middles, height = _pegs(values, self._size)
        self.pegs = [
            self._server.scene.add_box(
                f"{self._path}/peg{i}", color=ROLES["tool"], position=middle,
                dimensions=(_PEG * self._size, _PEG * self._size, height),
            )
            for i, middle in enumerate(middles)
        ]  # fmt: skip

    def draw(self, tip: Array, view: ArmView) -> None:
        """Draw the fingers at a tip (7,), and the object where it is told to be."""
        state, place = view.get(SLAVE_JAW_MEASURED_JS), view.get(SLAVE_JAW_OBJECT_CP)
        if state is not None and self._length > 0.0:
            if not self.fingers:
                thick = _THICK * self._length
                self.fingers = [
                    self._server.scene.add_box(
                        f"{self._path}/finger{i}", color=ROLES["tool"],
                        dimensions=(thick, 2.0 * thick, self._length),
                    )
                    for i in range(2)
                ]  # fmt: skip
            for node, pose in zip(
                self.fingers, finger_poses(tip, state[0], self._length), strict=True
            ):
                move(node, pose)
        if place is not None and self._size > 0.0 and place[:3].any():  # zero: there is no object
            if self.block is None:
                self.block = self._box("object")
            move(self.block, place)
            self._draw_others(place, view.get(SLAVE_JAW_BOARD))

    def _draw_others(self, place: Array, board: Array | None) -> None:
        """Draw the objects that do not move, upright; the one near ``place`` (7,) lies below it."""
        middles = [] if board is None else [m for m in board[_FIRST:].reshape(-1, 3) if m.any()]
        for i, middle in enumerate(middles if len(middles) > 1 else []):
            if i not in self.blocks:
                self.blocks[i] = self._box(f"object{i}")
            is_moving = np.abs(middle - place[:3]).max() < 0.5 * self._size
            move(self.blocks[i], place if is_moving else np.array([*middle, 1.0, 0.0, 0.0, 0.0]))

    def _box(self, name: str) -> viser.BoxHandle:
        return self._server.scene.add_box(
            f"{self._path}/{name}", color=TARGET, dimensions=(self._size,) * 3
        )


def _pegs(values: Mapping[str, Setting], size: float) -> tuple[Array, float]:
    """Middles (N, 3) of the pegs, and how high they are [m]."""
    objects, axes = (
        np.array(value if isinstance(value := values.get(name), tuple) else (), dtype=np.float64)
        for name in ("object.place", "pegs.place")
    )
    height = values.get("pegs.height")
    if not len(objects) or not isinstance(height, float):
        return np.empty((0, 3)), 0.0
    middles = np.insert(axes.reshape(-1, 2), 2, objects[2] + 0.5 * (height - size), axis=1)
    return middles, height
