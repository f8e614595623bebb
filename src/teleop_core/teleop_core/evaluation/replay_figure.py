"""Replay: what a page needs to show a robot moving as recorded: its solids, and its joints in time.

The page places the bodies itself, from the coordinates of the tree that they are; so a page holds a
few numbers for each moment instead of all corners, or the pose of each body.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.figure import FIXTURE, MEASURED, SURROUNDING, Figure, Numbers, along
from teleop_core.evaluation.outlines import Outline, largest
from teleop_core.evaluation.packing import Packed, pack_to
from teleop_core.kernels.geometry import Array
from teleop_core.robots.bodies import Bodies, Role, bodies_of
from teleop_core.robots.bodies.meshes import merged, mesh_of
from teleop_core.robots.robot import Robot

ROLES: tuple[Role, ...] = ("base", "link", "joint", "leg", "platform", "tool")
_MANY = 30  # solids, of which fewer sides are enough
Indices = NDArray[np.int64]


class Mesh(NamedTuple):
    """Triangles of all bodies of a robot.

    Attributes:
        points: Corners (V, 3) [m], each in the frame of its body.
        faces: Corners of each triangle (F, 3).
        body: Body of each corner (V,).
        role: Index among :data:`ROLES` of what each corner is part of (V,).
    """

    points: Array
    faces: Indices
    body: Indices
    role: Indices


def robot_mesh(bodies: Bodies) -> Mesh:
    """Triangles of all solids; those of a body stand together, in the order of the bodies."""
    owned = [(number, solid) for number, body in enumerate(bodies.bodies) for solid in body.solids]
    sides = 8 if len(owned) > _MANY else 12
    shapes = [mesh_of(solid, sides) for _, solid in owned]
    counts = [len(points) for points, _ in shapes]
    return Mesh(
        *merged(shapes),
        np.repeat([number for number, _ in owned], counts),
        np.repeat([ROLES.index(solid.role) for _, solid in owned], counts),
    )


def posed(points: Array, poses: Array) -> Array:
    """Points (V, 3) that poses (V, 7) of their own bring elsewhere."""
    w, v = poses[:, 3:4], poses[:, 4:]
    # Rodrigues' formula with quaternions: p + 2 v × (v × p + w p).
    return np.asarray(
        poses[:, :3] + points + 2.0 * np.cross(v, np.cross(v, points) + w * points), dtype=float
    )


ROOM = 400_000
"""Bytes for the motion in one replay; longer ones have fewer moments."""
FINEST = 1e-5
"""Steps to which coordinates are rounded [rad, m]: some micrometres at the tip."""
_MM = 1e3
_LOOKED_AT = 100  # moments that decide how much of space is drawn
_COLORS = ("#5c6670", "#b9c2cc", "#4c8fcc", "#b9c2cc", "#8fb4d6", "#e8a100")
_CAMERA = {"eye": {"x": 1.0, "y": -1.2, "z": 0.55}, "center": {"x": 0, "y": 0, "z": -0.12}}


def replay_figure(
    robot: Robot,
    begin_s: float,
    step_s: float,
    joints: Array,
    path: tuple[Numbers, Numbers],
    outlines: list[Outline],
) -> Figure:
    """Robot, path of its tip and fixtures, to be played.

    Args:
        robot: What moved.
        begin_s: Time of the first moment [s].
        step_s: Time between moments [s].
        joints: Joint positions (N, n) at the moments [rad, m]; NaN where they are not known.
        path: Times (M,) [s] and points (M, 3) [mm] of the tip's path.
        outlines: Fixtures.
    """
    bodies = bodies_of(robot)
    mesh, motion, every = robot_mesh(bodies), *_motion(bodies, joints)
    tree = {
        "parents": [body.parent for body in bodies.bodies],
        "kinds": [int(body.joint) for body in bodies.bodies],
        "places": [body.coordinate for body in bodies.bodies],
        "origins": [body.origin.tolist() for body in bodies.bodies],
        "body": mesh.body.tolist(),
        "local": list((_MM * mesh.points).round(3).T),
    }
    moments = {"begin": begin_s, "step": every * step_s, "count": -(-len(joints) // every)}
    traces = [_solids(bodies, mesh, joints), _whole(path), _trail()]
    traces += [_fixture(outline, outlines) for outline in largest(outlines)]
    layout = {"scene": _scene(bodies, mesh, joints, outlines), "showlegend": False}
    layout["meta"] = {**tree, **moments, **motion}
    sentence = (
        f"The {robot.name} by its encoders, {1.0 / moments['step']:.3g} times a second; red is "
        f"where the tip has just been{', green a fixture that is on' * bool(outlines)}."
    )
    return Figure("Replay", sentence, traces, layout, 480)


def _motion(bodies: Bodies, joints: Array) -> tuple[dict[str, Any], int]:
    """Packed coordinates and free poses, and of how many moments one is kept so that they fit."""
    coordinates, free = bodies.coordinates(np.ascontiguousarray(joints))
    width = coordinates.shape[1]
    if free.size:
        coordinates = np.concatenate((coordinates, free.reshape(len(free), -1)), axis=1)
    every, packed = 1, _packed(coordinates)
    while sum(len(one.data) for one in packed) > ROOM:
        every *= 2
        packed = _packed(coordinates[::every])
    told = [vars(one) for one in packed]
    return {"coordinates": told[:width], "free": told[width:]}, every


def _packed(columns: Array) -> list[Packed]:
    return [pack_to(column, FINEST) for column in columns.T]


def _solids(bodies: Bodies, mesh: Mesh, joints: Array) -> dict[str, Any]:
    """All bodies as they stand first."""
    x, y, z = _MM * _corners(bodies, mesh, joints[:1])[0].T
    i, j, k = mesh.faces.T.tolist()
    top = len(ROLES) - 1
    scale = [[role / top, color] for role, color in enumerate(_COLORS)]
    return {
        "type": "mesh3d", "name": "robot", "x": x, "y": y, "z": z, "i": i, "j": j, "k": k,
        "intensity": mesh.role.tolist(), "cmin": 0, "cmax": top, "colorscale": scale,
        "showscale": False, "hoverinfo": "skip", "flatshading": True, "meta": {"part": "robot"},
        "lighting": {"ambient": 0.6, "diffuse": 0.7, "specular": 0.1},
    }  # fmt: skip


def _corners(bodies: Bodies, mesh: Mesh, joints: Array) -> Array:
    """Corners of all solids (N, V, 3) in the base [m]."""
    poses = bodies.poses(joints)
    return np.array([posed(mesh.points, row[mesh.body]) for row in poses])


def _whole(path: tuple[Numbers, Numbers]) -> dict[str, Any]:
    times, points = path
    return along(_line(points, SURROUNDING, 1.5, "whole path"), times, whole=True)


def _trail() -> dict[str, Any]:
    return {**_line(np.full((2, 3), np.nan), MEASURED, 5.0, "tip"), "meta": {"part": "trail"}}


def _fixture(outline: Outline, outlines: list[Outline]) -> dict[str, Any]:
    """Outline of a fixture with all the time that it was on at this place."""
    on = [[one.begin_s, one.end_s] for one in outlines if one.place == outline.place]
    drawn = _line(outline.points, FIXTURE, 4.0, outline.kind)
    return {**drawn, "meta": {"part": "fixture", "during": on}}


def _line(points: Numbers, color: str, width: float, name: str) -> dict[str, Any]:
    x, y, z = points.T
    return {
        "type": "scatter3d", "mode": "lines", "name": name, "x": x, "y": y, "z": z,
        "line": {"color": color, "width": width}, "hoverinfo": "skip",
    }  # fmt: skip


def _scene(bodies: Bodies, mesh: Mesh, joints: Array, outlines: list[Outline]) -> dict[str, Any]:
    """Space that holds all that is drawn at any time, with one scale along all axes."""
    some = joints[:: max(1, len(joints) // _LOOKED_AT)]
    corners = _MM * _corners(bodies, mesh, some).reshape(-1, 3)
    corners = np.concatenate((corners, *(outline.points for outline in outlines)))
    low, high = np.nanmin(corners, axis=0), np.nanmax(corners, axis=0)
    margin = 0.03 * float((high - low).max())
    axes = {
        f"{axis}axis": {
            "title": {"text": f"{axis} [mm]"},
            "range": [float(low[row]) - margin, float(high[row]) + margin],
        }
        for row, axis in enumerate("xyz")
    }
    return {**axes, "aspectmode": "data", "camera": _CAMERA}
