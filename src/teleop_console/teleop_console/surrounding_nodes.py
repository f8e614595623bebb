"""Surrounding nodes: the bodies of a scene on the page, moved by ``scene/poses``."""

import numpy as np
import viser

from teleop_console.link import ArmView
from teleop_console.poses import move
from teleop_core.graph.topics import POSES, SCENE_POSES
from teleop_core.kernels.geometry import Array
from teleop_core.robots.bodies.frames import inverse, pose_of
from teleop_core.robots.robot import Robot

PATH = "/scene"
"""Path of the node in the world of the scene."""


class SurroundingNodes:
    """Bodies of the scene in which the first arm of a session stands; without a scene there are none.

    Args:
        server: The page, whose axes are those of the arm's base.
        robot: The arm.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        shapes = robot.surroundings() if robot.world_base is not None else ()
        self._frames: dict[int, viser.FrameHandle] = {}
        self._root: viser.FrameHandle | None = None
        if not shapes or robot.world_base is None:
            return
        self._root = server.scene.add_frame(PATH, show_axes=False)
        move(self._root, inverse(pose_of(robot.world_base)))
        for number, shape in enumerate(shapes):
            above = PATH
            if shape.place >= 0:
                above = f"{PATH}/body{shape.place}"
                if shape.place not in self._frames:
                    self._frames[shape.place] = server.scene.add_frame(above, show_axes=False)
                    move(self._frames[shape.place], shape.begin)
            (vertices, faces), (red, green, blue) = shape.mesh, shape.color
            server.scene.add_mesh_simple(
                f"{above}/shape{number}",
                vertices.astype(np.float32),
                faces.astype(np.uint32),
                color=(round(255 * red), round(255 * green), round(255 * blue)),
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )

    def show(self, *, is_shown: bool) -> None:
        """Show the bodies, or hide them."""
        if self._root is not None:
            self._root.visible = is_shown

    def draw(self, view: ArmView) -> None:
        """Move the bodies to the newest poses; only changes are sent."""
        told: Array | None = view.get(SCENE_POSES)
        if told is None:
            return
        poses = told.reshape(POSES, 7)
        for place, frame in self._frames.items():
            if place < POSES and np.isfinite(poses[place]).all():
                move(frame, poses[place])
