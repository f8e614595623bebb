"""Looks: the meshes that a URDF gives its links, in the frames of the robot's bodies."""

import warnings

import numpy as np

from teleop_core.base import ParameterError, TeleopError, TeleopWarning
from teleop_core.kernels import product, rotations_from_quaternions
from teleop_core.robots.bodies.describe import bodies_of
from teleop_core.robots.bodies.meshes import Mesh, merged, mesh_of
from teleop_core.robots.body import HERE
from teleop_core.robots.files.visuals import mesh_file
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import Solid
from teleop_core.robots.visual import Visual


def looks_of(robot: Robot) -> dict[int, Mesh]:
    """Meshes of the bodies of a robot, by the index of the body in :func:`bodies_of`.

    For a mesh that cannot be read, a warning names its link. A body without any readable mesh is not among the keys.
    Files are read again at each call.
    """
    bodies = bodies_of(robot)
    frames = bodies.poses(robot.home)
    parts: dict[int, list[Mesh]] = {}
    for visual in robot.visuals:
        try:
            vertices, faces = _triangles(visual)
        except TeleopError as error:
            warnings.warn(f"link {visual.link} is drawn without: {error}", TeleopWarning, stacklevel=2)
            continue
        placed = product(vertices, visual.place[:3, :3].T) + visual.place[:3, 3]
        frame = frames[visual.joints]
        seen = product(placed - frame[:3], rotations_from_quaternions(frame[None, 3:])[0])
        parts.setdefault(visual.joints, []).append((seen, faces))
    return {body: merged(meshes) for body, meshes in parts.items()}


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
