"""Scene nodes: the bodies of a scene on the page, at the poses of ``scene/poses``."""

from collections.abc import Sequence

import numpy as np
import viser

from teleop_console.body_nodes import add_look
from teleop_console.link import ArmView
from teleop_console.poses import moved, set_pose
from teleop_core.graph.topics import SCENE_POSES
from teleop_core.kernels import Array, geometry, inverse_motion
from teleop_core.robots.bodies.frames import pose_of
from teleop_core.robots.bodies.looks import Look
from teleop_core.robots.scenery import Scenery


class SceneNodes:
    """Bodies of a scene, one frame each.

    Args:
        server: The page.
        path: Path of the arm's node, whose origin is the arm's base.
        scenery: What the scene looks like.
    """

    def __init__(self, server: viser.ViserServer, path: str, scenery: Scenery) -> None:
        world_base, root = np.empty((4, 4)), f"{path}/scene"
        geometry.transform_from_pose(np.array(scenery.base, np.float64), world_base)
        self.root = server.scene.add_frame(root, show_axes=False)
        set_pose(self.root, pose_of(inverse_motion(world_base)))
        self._draw_looks(server, f"{root}/fixed", scenery.fixed)
        names = [f"{root}/{number}_{name}" for number, (name, _) in enumerate(scenery.bodies)]
        self.frames = [server.scene.add_frame(name, show_axes=False) for name in names]
        for frame, (_, looks) in zip(self.frames, scenery.bodies, strict=True):
            self._draw_looks(server, frame.name, looks)
        self._drawn: Array = np.full((len(self.frames), 7), np.inf)
        self._move(scenery.start)

    @staticmethod
    def _draw_looks(server: viser.ViserServer, path: str, looks: Sequence[Look]) -> None:
        for number, look in enumerate(looks):
            add_look(server, f"{path}/{number}", "link", look.mesh, color=look.color, is_ghost=False, is_flat=True)

    def draw(self, view: ArmView) -> None:
        """Draw the bodies at their newest poses; a body beyond those of a message stays where it began."""
        told = view.get(SCENE_POSES)
        if told is not None:
            self._move(told.reshape(-1, 7)[: len(self.frames)])

    def _move(self, poses: Array) -> None:
        for body in moved(poses, self._drawn[: len(poses)]):
            set_pose(self.frames[body], poses[body])
            self._drawn[body] = poses[body]
