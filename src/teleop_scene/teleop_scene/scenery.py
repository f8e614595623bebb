"""Scenery: the shapes of a model as triangles, each in the frame of the body that moves it."""

import mujoco
import numpy as np

from teleop_core.kernels import Array, rotations_from_quaternions
from teleop_core.robots.bodies.frames import pose_of
from teleop_core.robots.bodies.looks import Look
from teleop_core.robots.bodies.meshes import Mesh, merged, mesh_of
from teleop_core.robots.scenery import Scenery
from teleop_core.robots.solids import Kind, Solid
from teleop_scene import models

_SEEN_GROUPS = 3
"""Geoms of the groups from this one on are for collisions only, by MuJoCo's custom."""
_HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
_SOLIDS: dict[int, Kind] = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_PLANE: "box",
}
_THIN = 2e-3  # thickness of a drawn plane [m]
_MOST_FACES = 20_000  # of a mesh; a page stays quick


def scenery(model: mujoco.MjModel, world_base: Array, begin: Array) -> Scenery:
    """Looks of all bodies of a model; infinite planes, height fields and invisible geoms are left out.

    Args:
        model: The model.
        world_base: Pose (4, 4) of the arm's base in the world.
        begin: Positions (nq,) of all joints at the start of a session.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = begin
    mujoco.mj_kinematics(model, data)
    moving = models.moving_bodies(model)
    meshes: dict[int, dict[tuple[float, float, float], list[Mesh]]] = {}
    for geom in range(model.ngeom):
        if model.geom_group[geom] >= _SEEN_GROUPS or _color(model, geom)[3] == 0.0:
            continue
        if (mesh := _triangles(model, geom)) is not None:
            body = _mover(model, int(model.geom_bodyid[geom]))
            color = tuple(_color(model, geom)[:3].tolist())
            meshes.setdefault(body, {}).setdefault(color, []).append(_placed(data, geom, body, mesh))  # type: ignore[arg-type]
    looks = {
        body: tuple(Look(merged(parts), color) for color, parts in by_color.items())
        for body, by_color in meshes.items()
    }
    named = [(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, b) or f"body{b}", looks.get(b, ())) for b in moving]
    start = np.hstack((data.xpos[moving], data.xquat[moving]))
    return Scenery(pose_of(world_base), looks.get(0, ()), tuple(named), start)


def _color(model: mujoco.MjModel, geom: int) -> Array:
    """Red, green, blue and opacity of a geom."""
    material = int(model.geom_matid[geom])
    return np.asarray(model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom], np.float64)


def _mover(model: mujoco.MjModel, body: int) -> int:
    """Nearest body with joints, from a body towards the world; 0 for the world."""
    while body and not model.body_jntnum[body]:
        body = int(model.body_parentid[body])
    return body


def _triangles(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Triangles of a geom in its own frame; None for one that is not drawn."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom].astype(np.float64)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        begin, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        if faces > _MOST_FACES:
            return _hull(model.mesh_vert[first : first + count])
        return (
            model.mesh_vert[first : first + count].astype(np.float64),
            model.mesh_face[begin : begin + faces].astype(np.int64),
        )
    if kind not in _SOLIDS or (kind == mujoco.mjtGeom.mjGEOM_PLANE and 0.0 in size[:2]):
        return None
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        vertices, triangles = mesh_of(Solid("sphere", (1.0,), _HERE, "link"))
        return vertices * size, triangles
    sizes = {
        "sphere": size[:1],
        "capsule": np.array([size[0], 2.0 * size[1]]),
        "cylinder": np.array([size[0], 2.0 * size[1]]),
        "box": 2.0 * size,
    }[_SOLIDS[kind]]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        sizes = np.array([2.0 * size[0], 2.0 * size[1], _THIN])
    return mesh_of(Solid(_SOLIDS[kind], tuple(sizes.tolist()), _HERE, "link"))


def _hull(vertices: Array) -> Mesh:
    """Box around a mesh that has too many triangles for a page."""
    low, high = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    pose = np.concatenate((0.5 * (low + high), _HERE[3:]))
    return mesh_of(Solid("box", tuple((high - low).tolist()), pose, "link"))


def _placed(data: mujoco.MjData, geom: int, body: int, mesh: Mesh) -> Mesh:
    """Triangles of a geom in the frame of the body that moves it."""
    turn = rotations_from_quaternions(data.xquat[body][None])[0]
    in_world = mesh[0] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return (in_world - data.xpos[body]) @ turn, mesh[1]
