"""Hybrid robot: bodies of the SCARA that carries a Stewart platform."""

from collections.abc import Mapping

import numpy as np

from teleop_core.kernels import Array, kernel, product
from teleop_core.robots.bodies.frames import pose, tips
from teleop_core.robots.body import HERE, Bodies, Body, Coordinates, Joint
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import ball, capsule, cylinder
from teleop_machines.bodies import parallel, planar
from teleop_machines.scara_stewart_legs import layout

_LEGS = slice(4, 9)  # part of the geometry that the leg kernels use
_UP = np.array([0.0, 0.0, 1.0])


@kernel
def joint_points(g: Array, points: Array) -> None:
    """Write base joints and platform joints of the legs (2, 6, 3) [m]."""
    layout(g, points)


def scara_stewart_bodies(robot: Robot) -> Bodies:
    """Arm, rod, Stewart base, telescopes, platform and tool.

    If link 2 carries the Stewart base, the Stewart base turns with link 2; otherwise it keeps the base's heading.
    """
    points = np.empty((2, 6, 3))
    joint_points(robot.geometry_row[_LEGS], points)
    arm = _arm(robot, points[0])
    radius = 0.06 * robot.geometry["r_m"]
    legs = parallel.Telescope(float(robot.lower[3:].min()), float(robot.upper[3:].max()), radius)
    count = 6 * legs.tubes
    bodies = [*arm, *legs.bodies(6)]
    tool = capsule(np.zeros(3), robot.geometry["e_eff"] * _UP, 2.0 * radius, "platform")
    bodies.append(Body("platform", (*parallel.plate(points[1], radius), tool), 0, Joint.FREE, HERE, count))
    origin = pose(z=robot.geometry["e_eff"])
    bodies.append(Body("tip", (ball(np.zeros(3), 3.0 * radius, "tool"),), len(bodies) - 1, origin=origin))
    upper = tuple(len(arm) + (leg + 1) * legs.tubes - 1 for leg in range(6))
    size = robot.geometry["l1"] + robot.geometry["l2"] + robot.geometry["w_z"]
    return Bodies(tuple(bodies), 9, _coordinates(robot, legs, points), (1, 2, 3, *upper), size)


def _arm(robot: Robot, joints: Array) -> list[Body]:
    g, stroke = robot.geometry, float(robot.upper[2] - robot.lower[2])
    radius = 0.03 * (g["l1"] + g["l2"])
    column = capsule(np.zeros(3), g["h1"] * _UP, 1.2 * radius, "base")
    foot = cylinder(-0.5 * radius * _UP, _UP, 3.0 * radius, radius, "base")
    rod = capsule(-stroke * _UP, np.zeros(3), 0.6 * radius, "link")
    return [
        Body("base", (foot, column), -1),
        Body("link1", planar.pivoted(g["l1"], radius), 0, Joint.REVOLUTE, pose(z=g["h1"]), 0),
        Body("link2", planar.pivoted(g["l2"], 0.9 * radius), 1, Joint.REVOLUTE, pose(x=g["l1"]), 1),
        Body("rod", (rod,), 2, Joint.PRISMATIC, pose(x=g["l2"]), 2),
        Body("stewart_base", parallel.plate(joints, 0.3 * radius), 3, Joint.REVOLUTE, HERE, 9),
    ]


def _coordinates(robot: Robot, legs: parallel.Telescope, points: Array) -> Coordinates:
    g, is_carried = robot.geometry, robot.geometry["carried"]

    def coordinates(q: Array) -> tuple[Array, Array]:
        transforms, poses = tips(robot, q)
        turned = q[:, 0] + q[:, 1]
        places = poses.copy()
        places[:, :3] -= g["e_eff"] * transforms[:, :3, 2]
        rotations = transforms[:, :3, :3].swapaxes(1, 2)
        ends = product(points[1], rotations) + places[:, None, :3]
        heading = is_carried * turned
        c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
        x, y = points[0, :, 0], points[0, :, 1]
        starts = np.stack((c * x - s * y, s * x + c * y, np.zeros(c.shape) + 0.0 * x), axis=-1)
        starts += _seat(g, q)[:, None]
        free = np.concatenate((legs.poses(starts, ends), places[:, None]), axis=1)
        return np.column_stack((q, heading - turned)), free

    return coordinates


def _seat(g: Mapping[str, float], q: Array) -> Array:
    """Centre of the Stewart base (N, 3) [m], which is the end of the rod."""
    turned = q[:, 0] + q[:, 1]
    x = g["l1"] * np.cos(q[:, 0]) + g["l2"] * np.cos(turned)
    y = g["l1"] * np.sin(q[:, 0]) + g["l2"] * np.sin(turned)
    return np.stack((x, y, g["h1"] + q[:, 2]), axis=-1)
