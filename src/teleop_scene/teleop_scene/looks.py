"""Looks: the shapes of a scene as triangles, in the frames of the bodies that move them."""

import mujoco
import numpy as np

from teleop_core.kernels import Array
from teleop_core.robots.bodies.meshes import Mesh, merged, mesh_of
from teleop_core.robots.body import HERE
from teleop_core.robots.solids import Kind, Solid
from teleop_core.robots.visual import Color, Surrounding
from teleop_scene import chain, models

_GROUPS = 3  # geometries of higher groups are collision shapes, which viewers do not show either
_FLOOR = 1.0  # half width of an endless plane [m]
_THIN = 0.002  # half thickness of a plane [m]
_SOLIDS: dict[int, Kind] = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
}
_PLANE, _ELLIPSOID, _MESH = (int(getattr(mujoco.mjtGeom, f"mjGEOM_{x}")) for x in ("PLANE", "ELLIPSOID", "MESH"))


def surroundings_of(model: mujoco.MjModel, begin: Array) -> tuple[Surrounding, ...]:
    """Shapes of a scene, one for each moving body and colour.

    Args:
        model: The model.
        begin: Positions (nq,) of all joints at the start.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = begin
    mujoco.mj_kinematics(model, data)
    moving = models.moving_bodies(model)
    parts: dict[tuple[int, Color], list[Mesh]] = {}
    for g in range(model.ngeom):
        mesh, color = _mesh(model, g), _color(model, g)
        if mesh is None or color is None or model.geom_group[g] >= _GROUPS:
            continue
        carrier = next((b for b in chain.ancestors(model, int(model.geom_bodyid[g])) if b in moving), 0)
        R, place = data.xmat[carrier].reshape(3, 3), data.xpos[carrier]
        points = mesh[0] @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]
        index = moving.index(carrier) if carrier else -1
        parts.setdefault((index, color), []).append(((points - place) @ R, mesh[1]))
    found = []
    for (index, color), meshes in parts.items():
        body = moving[index] if index >= 0 else 0
        pose = np.concatenate((data.xpos[body], data.xquat[body]))
        found.append(Surrounding(index, merged(meshes), color, pose))
    return tuple(found)


def _mesh(model: mujoco.MjModel, g: int) -> Mesh | None:
    """Triangles of a geometry in its own frame; None for kinds that are not drawn."""
    kind, size = int(model.geom_type[g]), model.geom_size[g].tolist()
    if kind == _MESH:
        m = int(model.geom_dataid[g])
        first, count = int(model.mesh_vertadr[m]), int(model.mesh_vertnum[m])
        face, faces = int(model.mesh_faceadr[m]), int(model.mesh_facenum[m])
        vertices = np.array(model.mesh_vert[first : first + count], np.float64)
        return vertices, np.array(model.mesh_face[face : face + faces], np.int64)
    if kind == _PLANE:
        half = [x or _FLOOR for x in size[:2]]
        return mesh_of(Solid("box", (2.0 * half[0], 2.0 * half[1], 2.0 * _THIN), HERE, "base"))
    if kind == _ELLIPSOID:
        vertices, triangles = mesh_of(Solid("sphere", (1.0,), HERE, "link"))
        return vertices * size, triangles
    if kind not in _SOLIDS:
        return None
    name = _SOLIDS[kind]
    sizes = {"box": [2.0 * x for x in size], "sphere": size[:1]}.get(name, [size[0], 2.0 * size[1]])
    return mesh_of(Solid(name, tuple(sizes), HERE, "link"))


def _color(model: mujoco.MjModel, g: int) -> Color | None:
    """Colour of a geometry; None if it is transparent."""
    material = int(model.geom_matid[g])
    r, g_, b, a = (model.mat_rgba[material] if material >= 0 else model.geom_rgba[g]).tolist()
    return (r, g_, b) if a > 0.0 else None
