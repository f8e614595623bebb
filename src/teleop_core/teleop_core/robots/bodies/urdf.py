"""URDF: bodies of a robot as the XML that RViz, Foxglove and physics engines read.

Joints that move one body appear with axis and limits. A body that follows one joint by a factor and an offset has a
joint with ``mimic``. URDF has no joints for legs and platforms of robots with loops, nor for links that several joints
move. These bodies get floating joints, and ``/tf`` contains their poses. URDF has no capsules: a capsule becomes a
cylinder with two spheres. Each shape is both visual and collision geometry.
"""

import math
from collections.abc import Iterator
from xml.etree import ElementTree as Xml

import numpy as np

from teleop_core.kernels import Array, product, rotation, rotations_from_quaternions
from teleop_core.robots.bodies.describe import bodies_of
from teleop_core.robots.bodies.inertials import DENSITY, has_own_links, inertials_of
from teleop_core.robots.body import HERE, Bodies, Body, Joint
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import Role, Solid

COLOURS: dict[Role, tuple[float, float, float]] = {
    "base": (0.30, 0.32, 0.35),
    "link": (0.80, 0.82, 0.85),
    "joint": (0.16, 0.38, 0.62),
    "leg": (0.62, 0.64, 0.68),
    "platform": (0.93, 0.68, 0.20),
    "tool": (0.80, 0.25, 0.22),
}
"""Red, green and blue, from 0 to 1, of solids by their role."""
_EXACT = 1e-9  # a body follows a joint if its largest error is smaller [rad, m]
_TYPES = {Joint.FIXED: "fixed", Joint.REVOLUTE: "revolute", Joint.PRISMATIC: "prismatic"}


def urdf_of(robot: Robot, name: str = "", prefix: str = "") -> str:
    """URDF of a robot: a link for each of its bodies, the base as the root.

    Args:
        robot: The robot.
        name: Name of the model; empty for the robot's own.
        prefix: Prefix of the names of links and joints, such as ``slave_``, so that the root is ``slave_base``.

    Returns:
        The XML. Limits are those of the robot. Speeds and efforts are those of its drives, or 0 without drives.
        Inertias are those of the robot's own links if its model contains them, else assumed
        (:mod:`~teleop_core.robots.bodies.inertials`). A comment at the top states whether they are assumed, and which
        bodies have no inertia. The base has no inertia, because programs that read a URDF warn if the root has one. A
        URDF cannot contain the inertia of a motor.
    """
    bodies = bodies_of(robot)
    inertials = inertials_of(robot, bodies)
    root = Xml.Element("robot", name=name or robot.name)
    without = [body.name for i, body in enumerate(bodies.bodies) if i and i not in inertials]
    root.append(Xml.Comment(_remark(robot, without)))
    for role, colour in COLOURS.items():
        material = Xml.SubElement(root, "material", name=role)
        Xml.SubElement(material, "color", rgba=_row((*colour, 1.0)))
    for index, body in enumerate(bodies.bodies):
        link = Xml.SubElement(root, "link", name=prefix + body.name)
        if index in inertials:
            _inertial(link, inertials[index])
        for what in ("visual", "collision"):
            for solid in body.solids:
                _geometry(link, what, solid)
    joints = joints_of(bodies)
    for index, body in enumerate(bodies.bodies[1:], start=1):
        _joint(root, robot, bodies, body, joints.get(index), prefix)
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def joints_of(bodies: Bodies) -> dict[int, int]:
    """Indices of the bodies that a joint of the robot moves, with the index of that joint."""
    found: dict[int, int] = {}
    for index, body in enumerate(bodies.bodies):
        is_joint = body.joint in {Joint.REVOLUTE, Joint.PRISMATIC} and body.coordinate < bodies.n
        if is_joint and body.coordinate not in found.values():
            found[index] = body.coordinate
    return found


def _joint(root: Xml.Element, robot: Robot, bodies: Bodies, body: Body, joint: int | None, prefix: str) -> None:
    is_fixed = body.joint is Joint.FIXED
    follows = None if is_fixed or joint is not None else _follows(robot, bodies, body)
    name = f"{body.name}_joint" if joint is None else robot.joint_names[joint]
    if follows is not None:  # sorts after its leader's name: pinocchio reads joints in the order of names
        name = f"{robot.joint_names[follows[0]]}_{body.name}"
    is_floating = joint is None and follows is None and not is_fixed
    kind = "floating" if is_floating else _TYPES[body.joint]
    element = Xml.SubElement(root, "joint", name=prefix + name, type=kind)
    Xml.SubElement(element, "parent", link=prefix + bodies.names[max(body.parent, 0)])
    Xml.SubElement(element, "child", link=prefix + body.name)
    if kind != "floating":
        _origin(element, body.origin)
    if is_fixed or is_floating:
        return
    Xml.SubElement(element, "axis", xyz="0 0 1")
    if joint is not None:
        _limit(element, robot, joint, 1.0, 0.0)
    elif follows is not None:
        leader, factor, offset = follows
        texts = {"multiplier": repr(factor), "offset": repr(offset)}
        Xml.SubElement(element, "mimic", texts, joint=prefix + robot.joint_names[leader])
        _limit(element, robot, leader, factor, offset)


def _limit(element: Xml.Element, robot: Robot, joint: int, factor: float, offset: float) -> None:
    """Write the limits of a joint whose value is ``factor`` times a joint of the robot, plus ``offset``."""
    ends = sorted(factor * end + offset for end in (robot.lower[joint], robot.upper[joint]))
    speed = effort = 0.0
    if robot.drives is not None:
        speed = abs(factor) * robot.drives.speed_limit[joint]
        effort = robot.drives.effort_limit[joint] / abs(factor)
    limits = {"lower": ends[0], "upper": ends[1], "velocity": speed, "effort": effort}
    Xml.SubElement(element, "limit", {key: repr(float(value)) for key, value in limits.items()})


def _follows(robot: Robot, bodies: Bodies, body: Body) -> tuple[int, float, float] | None:
    """The joint of the URDF that a body follows, with factor and offset; None if the body follows no single joint."""
    if body.joint not in _TYPES:
        return None
    draws = np.random.default_rng(0).uniform(robot.lower, robot.upper, (5, robot.n))
    rows = np.concatenate((np.zeros((1, robot.n)), np.eye(robot.n), draws))
    values = bodies.coordinates(rows)[0][:, body.coordinate]
    slopes = values[1 : robot.n + 1] - values[0]
    leaders = np.flatnonzero(slopes)
    if len(leaders) != 1:
        return None
    leader = int(leaders[0])
    if leader not in joints_of(bodies).values():
        return None
    factor, offset = float(slopes[leader]), float(values[0])
    off = np.abs(factor * draws[:, leader] + offset - values[robot.n + 1 :]).max()
    return (leader, factor, offset) if off < _EXACT else None


def _remark(robot: Robot, without: list[str]) -> str:
    """Comment on the inertias of the URDF, for people who read it."""
    if not has_own_links(robot):
        return (
            f" Inertias are assumed: bodies as drawn, of {DENSITY:g} kg/m3 throughout, for no"
            " masses of links are known of this robot. "
        )
    lumped = f" None of {', '.join(without)}: others hold their masses." if without else ""
    return f" Inertias are those of the robot's model, without its motors.{lumped} "


def _inertial(link: Xml.Element, pseudo: Array) -> None:
    """Write mass, centre, and inertia about the centre in the axes of the link."""
    element, mass = Xml.SubElement(link, "inertial"), float(pseudo[3, 3])
    center = pseudo[:3, 3] / mass
    squares = pseudo[:3, :3] - mass * np.outer(center, center)
    tensor = np.trace(squares) * np.eye(3) - squares
    _origin(element, np.concatenate((center, HERE[3:])))
    Xml.SubElement(element, "mass", value=repr(mass))
    entries = [(i, j) for i in range(3) for j in range(i, 3)]
    texts = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(tensor[i, j])) for i, j in entries}
    Xml.SubElement(element, "inertia", texts)


def _geometry(link: Xml.Element, what: str, solid: Solid) -> None:
    for pose, shape, sizes in _shapes(solid):
        element = Xml.SubElement(link, what)
        _origin(element, pose)
        Xml.SubElement(Xml.SubElement(element, "geometry"), shape, sizes)
        if what == "visual":
            Xml.SubElement(element, "material", name=solid.role)


def _shapes(solid: Solid) -> Iterator[tuple[Array, str, dict[str, str]]]:
    """Poses (7,), names and sizes of the URDF shapes that make up a solid."""
    if solid.kind == "box":
        yield solid.pose, "box", {"size": _row(solid.size)}
        return
    radius = {"radius": repr(float(solid.size[0]))}
    if solid.kind == "sphere":
        yield solid.pose, "sphere", radius
        return
    if solid.size[1] > 0.0:
        yield solid.pose, "cylinder", radius | {"length": repr(float(solid.size[1]))}
    if solid.kind == "capsule":
        axis = rotations_from_quaternions(solid.pose[3:])[:, 2]
        for side in (-0.5, 0.5):
            end = solid.pose[:3] + side * solid.size[1] * axis
            yield np.concatenate((end, (1.0, 0.0, 0.0, 0.0))), "sphere", radius


def _origin(element: Xml.Element, pose: Array) -> None:
    """Write a pose; near the pole, roll is computed from the rotation that yaw leaves, so that no digit is lost."""
    R = rotations_from_quaternions(pose[3:])
    yaw = math.atan2(R[1, 0], R[0, 0])
    R = product(rotation("z", -yaw), R)
    angles = (math.atan2(-R[1, 2], R[1, 1]), math.atan2(-R[2, 0], R[0, 0]), yaw)
    Xml.SubElement(element, "origin", xyz=_row(pose[:3]), rpy=_row(angles))


def _row(numbers: Array | tuple[float, ...]) -> str:
    return " ".join(repr(float(number) + 0.0) for number in numbers)
