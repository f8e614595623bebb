"""Looks: the meshes that a URDF gives its links, in the frames of the robot's bodies."""

import warnings
from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, TeleopError, TeleopWarning
from teleop_core.kernels import Array, product, rotations_from_quaternions, transform
from teleop_core.robots.bodies.describe import bodies_of
from teleop_core.robots.bodies.frames import pose_of
from teleop_core.robots.bodies.meshes import Mesh, merged, mesh_of
from teleop_core.robots.body import HERE
from teleop_core.robots.files.visuals import mesh_file
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import Solid
from teleop_core.robots.visual import Color, Visual


@dataclass(frozen=True, eq=False)
class Look:
    """Triangles of one colour.

    Attributes:
        mesh: Vertices (V, 3) [m] and faces (F, 3).
        color: Red, green and blue, from 0 to 1; None if the file states no colour.
    """

    mesh: Mesh
    color: Color | None = None


@dataclass(frozen=True, eq=False)
class Finger:
    """A shape that the jaw moves.

    Attributes:
        look: The shape in its own frame.
        body: Index of the body that carries the shape.
        rest: Pose (7,) of the shape in the frame of the body while no jaw moves the shape.
        poses: Poses (K, 7) from the closed to the open jaw.
    """

    look: Look
    body: int
    rest: Array
    poses: Array

    def pose(self, share: float) -> Array:
        """Pose (7,) for a share of the jaw's opening, 0 (closed) to 1."""
        return np.asarray(self.poses[round(min(max(share, 0.0), 1.0) * (len(self.poses) - 1))])


def looks_of(robot: Robot) -> dict[int, tuple[Look, ...]]:
    """Looks of the bodies of a robot, one for each colour, by the index of the body in :func:`bodies_of`.

    For a mesh that cannot be read, a warning names its link. A body without any readable mesh is not among the keys.
    Shapes that the jaw moves are in :func:`fingers_of`. Files are read again at each call.
    """
    frames = bodies_of(robot).poses(robot.home)
    parts: dict[int, dict[Color | None, list[Mesh]]] = {}
    for visual in robot.visuals:
        if visual.travel is None and (mesh := _readable(visual)) is not None:
            T = _in_body(frames[visual.joints], visual.place)
            placed = product(mesh[0], T[:3, :3].T) + T[:3, 3]
            parts.setdefault(visual.joints, {}).setdefault(visual.color, []).append((placed, mesh[1]))
    return {
        body: tuple(Look(merged(meshes), color) for color, meshes in by_color.items())
        for body, by_color in parts.items()
    }


def fingers_of(robot: Robot) -> tuple[Finger, ...]:
    """Shapes of a robot's file that the jaw moves; warnings and files as in :func:`looks_of`."""
    frames, found = bodies_of(robot).poses(robot.home), []
    for visual in robot.visuals:
        if visual.travel is not None and (mesh := _readable(visual)) is not None:
            frame = frames[visual.joints]
            rest, *poses = (pose_of(_in_body(frame, T)) for T in (visual.place, *visual.travel))
            found.append(Finger(Look(mesh, visual.color), visual.joints, rest, np.stack(poses)))
    return tuple(found)


def _in_body(frame: Array, T: Array) -> Array:
    """Transform (4, 4) in the frame of a body with a pose (7,)."""
    turn = rotations_from_quaternions(frame[None, 3:])[0]
    return transform(product(turn.T, T[:3, :3]), product(turn.T, T[:3, 3] - frame[:3]))


def _readable(visual: Visual) -> Mesh | None:
    try:
        return _triangles(visual)
    except TeleopError as error:
        warnings.warn(f"link {visual.link} is drawn without: {error}", TeleopWarning, stacklevel=3)
        return None


def _triangles(visual: Visual) -> Mesh:
    """Triangles of a shape in its own frame.

    Raises:
        ParameterError: The file of the mesh does not exist, or cannot be read.
        TeleopError: The library that reads meshes is not installed.
    """
    if visual.kind != "mesh":
        return mesh_of(Solid(visual.kind, visual.size, HERE, "link"))
    try:
        import trimesh
    except ImportError as error:
        raise TeleopError("a mesh needs trimesh: pip install 'teleop_core[mesh]'") from error
    path = mesh_file(visual.file, visual.urdf)
    try:
        scene = trimesh.load_scene(path, process=False)
        if scene.units:
            scene = scene.convert_units("meters")
        mesh = scene.to_mesh()
        vertices, faces = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    except Exception as error:  # a third-party reader may raise anything for an arbitrary file
        needed = f"a mesh that can be read ({type(error).__name__}: {error})"
        raise ParameterError("mesh", str(path), needed) from error
    if not (len(faces) and np.isfinite(vertices).all()):
        raise ParameterError("mesh", str(path), "triangles with finite corners")
    return vertices * visual.size, faces
