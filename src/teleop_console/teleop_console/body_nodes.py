"""Body nodes: the bodies of an arm on the page; after the first drawing only their frames are sent."""

from collections.abc import Mapping, Sequence

import numpy as np
import viser

from teleop_console.look import HELD, ROLES, WANTED
from teleop_console.poses import moved, set_pose
from teleop_core.kernels.geometry import Array, rotations_from_quaternions
from teleop_core.robots.bodies import Bodies, Role, Solid
from teleop_core.robots.bodies.looks import Finger, Look
from teleop_core.robots.bodies.meshes import Mesh, merged, mesh_of
from teleop_core.robots.visual import Color as RobotColor

_HALO = 0.05
"""Radius of a halo, divided by the reach of the robot."""


class BodyNodes:
    """Bodies of a robot, one frame each with its solids as meshes that are sent once.

    Args:
        server: The page.
        path: Path of the node above the bodies.
        bodies: The robot's bodies.
        looks: Meshes that replace the solids of some bodies, by the index of the body.
        fingers: Shapes that the jaw moves.
        is_ghost: Whether the bodies are drawn transparent in one colour, without axes.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        path: str,
        bodies: Bodies,
        looks: Mapping[int, Sequence[Look]],
        fingers: Sequence[Finger] = (),
        *,
        is_ghost: bool = False,
    ) -> None:
        axis = 0.08 * bodies.size
        self._server, self._path, self._bodies = server, path, bodies
        self.frames = {
            body.name: server.scene.add_frame(
                f"{path}/{body.name}", show_axes=False, axes_length=axis, axes_radius=0.04 * axis
            )
            for body in bodies.bodies
        }
        self._list = list(self.frames.values())
        self._halos: dict[int, viser.IcosphereHandle] = {}
        self._meshes: list[viser.MeshHandle] = []
        for i, body in enumerate(bodies.bodies):
            place = f"{path}/{body.name}"
            role: Role = "link" if i else "base"
            for number, look in enumerate(looks.get(i, ())):
                name = f"{place}/{role}{number or ''}"
                mesh = _add_mesh(server, name, role, look.mesh, color=look.color, is_ghost=is_ghost, is_flat=True)
                self._meshes.append(mesh)
            if i not in looks:
                self._meshes += add_solids(server, place, body.solids, is_ghost=is_ghost).values()
        self._fingers = [(finger, self._add_finger(finger, k, is_ghost=is_ghost)) for k, finger in enumerate(fingers)]
        self._drawn = np.tile(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), (len(self._list), 1))
        self._marked: frozenset[int] = frozenset()

    def _add_finger(self, finger: Finger, number: int, *, is_ghost: bool) -> viser.FrameHandle:
        path = f"{self._path}/{self._bodies.names[finger.body]}/finger{number}"
        frame = self._server.scene.add_frame(path, show_axes=False)
        set_pose(frame, finger.rest)
        look = finger.look
        _add_mesh(self._server, f"{path}/tool", "tool", look.mesh, color=look.color, is_ghost=is_ghost, is_flat=True)
        return frame

    def grip(self, share: float) -> None:
        """Draw the fingers at a share of the jaw's opening, 0 (closed) to 1."""
        for finger, frame in self._fingers:
            set_pose(frame, finger.pose(share))

    def move(self, joints: Array) -> Array:
        """Draw the bodies at joint positions (n,) [rad, m]; returns the drawn poses (B, 7).

        A body whose position is not finite stays at its drawn pose.
        """
        poses = self._bodies.poses(joints)
        for body in moved(poses, self._drawn):
            set_pose(self._list[body], poses[body])
            self._drawn[body] = poses[body]
        return self._drawn.copy()

    def show(self, *, is_shown: bool) -> None:
        """Show the shapes of all bodies, or hide them; frames, axes and halos remain."""
        for mesh in self._meshes:
            mesh.visible = is_shown

    def mark(self, joints: frozenset[int]) -> None:
        """Show a halo around the given joints only; the colours of the bodies do not change."""
        bodies = frozenset(self._bodies.joint_body[joint] for joint in joints)
        for body in bodies ^ self._marked:
            if body not in self._halos:
                self._halos[body] = self._server.scene.add_icosphere(
                    f"{self._path}/{self._bodies.bodies[body].name}/limit",
                    radius=_HALO * self._bodies.size,
                    color=HELD,
                    opacity=0.35,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            self._halos[body].visible = body in bodies
        self._marked = bodies

    def show_axes(self, *, is_shown: bool) -> None:
        """Show the axes of every body's frame, or hide them."""
        for frame in self._list:
            frame.show_axes = is_shown


def add_solids(
    server: viser.ViserServer,
    path: str,
    solids: tuple[Solid, ...],
    *,
    is_ghost: bool = False,
    opacity: float | None = None,
) -> dict[Role, viser.MeshHandle]:
    """Add solids below a node, as one mesh for each role of the solids; an opacity of None is opaque."""
    meshes = {}
    for role in dict.fromkeys(solid.role for solid in solids):
        mesh = merged([mesh_of(solid) for solid in solids if solid.role == role])
        meshes[role] = _add_mesh(server, f"{path}/{role}", role, mesh, is_ghost=is_ghost, opacity=opacity)
    return meshes


def _add_mesh(
    server: viser.ViserServer,
    name: str,
    role: Role,
    mesh: Mesh,
    *,
    color: RobotColor | None = None,
    is_ghost: bool,
    is_flat: bool = False,
    opacity: float | None = None,
) -> viser.MeshHandle:
    vertices, faces = mesh
    own = ROLES[role] if color is None else (round(255 * color[0]), round(255 * color[1]), round(255 * color[2]))
    return server.scene.add_mesh_simple(
        name,
        vertices.astype(np.float32),
        faces.astype(np.uint32),
        color=WANTED if is_ghost else own,
        opacity=0.3 if is_ghost else opacity,
        flat_shading=is_flat,
        cast_shadow=False,
        receive_shadow=False,
    )


def extent(bodies: Bodies, joints: Array) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) [m] of the box around the bodies, in slave_base."""
    points = [np.zeros((1, 3))]
    for body, pose in zip(bodies.bodies, bodies.poses(joints), strict=True):
        if np.isfinite(pose).all():
            points.append(pose[None, :3])
            points += [_placed(solid, pose) for solid in body.solids]
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def _placed(solid: Solid, pose: Array) -> Array:
    """Vertices (V, 3) [m] of a solid of a body with this pose (7,)."""
    placed: Array = mesh_of(solid)[0] @ rotations_from_quaternions(pose[None, 3:])[0].T + pose[:3]
    return placed
