"""URDF: bodies of a robot as the XML that RViz, Foxglove and physics engines read.

Joints that move one body stand there with axis and limits. What the format has no joint for, legs
and platforms of robots with loops and links that several joints move, hangs on floating joints: it
is placed by ``/tf``. A capsule, which the format lacks, is a cylinder with two spheres.
"""

from collections.abc import Iterator
from xml.etree import ElementTree as Xml

import numpy as np

from teleop_core.kernels.geometry import Array, roll_pitch_yaw, rotations_from_quaternions
from teleop_core.robots.bodies.body import Bodies, Body, Joint
from teleop_core.robots.bodies.describe import bodies_of
from teleop_core.robots.bodies.solids import Role, Solid
from teleop_core.robots.robot import Robot

COLOURS: dict[Role, tuple[float, float, float]] = {
    "base": (0.30, 0.32, 0.35),
    "link": (0.80, 0.82, 0.85),
    "joint": (0.16, 0.38, 0.62),
    "leg": (0.62, 0.64, 0.68),
    "platform": (0.93, 0.68, 0.20),
    "tool": (0.80, 0.25, 0.22),
}
"""Red, green, blue, 0 to 1, of solids by their role."""
_TYPES = {Joint.FIXED: "fixed", Joint.REVOLUTE: "revolute", Joint.PRISMATIC: "prismatic"}


def urdf_of(robot: Robot, name: str = "", prefix: str = "") -> str:
    """URDF of a robot: a link for each of its bodies, the base as the root.

    Args:
        robot: The robot.
        name: Name of the model; empty for the robot's own.
        prefix: What stands before the names of links and joints, such as ``slave_``, so that
            the root is ``slave_base``.

    Returns:
        The XML. Limits are those of the robot, speeds and efforts those of its drives; 0 where
        it has none. It holds no inertias: what is known of them is of the joints, not of bodies.
    """
    bodies = bodies_of(robot)
    root = Xml.Element("robot", name=name or robot.name)
    for role, colour in COLOURS.items():
        material = Xml.SubElement(root, "material", name=role)
        Xml.SubElement(material, "color", rgba=_row((*colour, 1.0)))
    for body in bodies.bodies:
        link = Xml.SubElement(root, "link", name=prefix + body.name)
        for solid in body.solids:
            _visual(link, solid)
    joints = joints_of(bodies)
    for index, body in enumerate(bodies.bodies[1:], start=1):
        _joint(root, robot, bodies, body, joints.get(index), prefix)
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def joints_of(bodies: Bodies) -> dict[int, int]:
    """Bodies that hang on joints of the robot itself, by index, with the joint of each."""
    found: dict[int, int] = {}
    for index, body in enumerate(bodies.bodies):
        is_joint = body.joint in {Joint.REVOLUTE, Joint.PRISMATIC} and body.coordinate < bodies.n
        if is_joint and body.coordinate not in found.values():
            found[index] = body.coordinate
    return found


def _joint(
    root: Xml.Element, robot: Robot, bodies: Bodies, body: Body, joint: int | None, prefix: str
) -> None:
    is_fixed = body.joint is Joint.FIXED
    name = f"{body.name}_joint" if joint is None else robot.joint_names[joint]
    kind = "floating" if joint is None and not is_fixed else _TYPES[body.joint]
    element = Xml.SubElement(root, "joint", name=prefix + name, type=kind)
    Xml.SubElement(element, "parent", link=prefix + bodies.names[max(body.parent, 0)])
    Xml.SubElement(element, "child", link=prefix + body.name)
    if kind != "floating":
        _origin(element, body.origin)
    if joint is None:
        return
    Xml.SubElement(element, "axis", xyz="0 0 1")
    drives = robot.drives
    speed, effort = (
        (0.0, 0.0)
        if drives is None
        else (float(drives.speed_limit[joint]), float(drives.effort_limit[joint]))
    )
    limits = {"lower": robot.lower[joint], "upper": robot.upper[joint]}
    texts = {key: repr(float(value)) for key, value in limits.items()}
    Xml.SubElement(element, "limit", texts, velocity=repr(speed), effort=repr(effort))


def _visual(link: Xml.Element, solid: Solid) -> None:
    for pose, shape, sizes in _shapes(solid):
        visual = Xml.SubElement(link, "visual")
        _origin(visual, pose)
        Xml.SubElement(Xml.SubElement(visual, "geometry"), shape, sizes)
        Xml.SubElement(visual, "material", name=solid.role)


def _shapes(solid: Solid) -> Iterator[tuple[Array, str, dict[str, str]]]:
    """Poses (7,), names and sizes of the shapes of the format that make up a solid."""
    if solid.kind == "box":
        yield solid.pose, "box", {"size": _row(solid.size)}
        return
    radius = {"radius": repr(float(solid.size[0]))}
    if solid.kind == "sphere":
        yield solid.pose, "sphere", radius
        return
    yield solid.pose, "cylinder", radius | {"length": repr(float(solid.size[1]))}
    if solid.kind == "capsule":
        axis = rotations_from_quaternions(solid.pose[3:])[:, 2]
        for side in (-0.5, 0.5):
            end = solid.pose[:3] + side * solid.size[1] * axis
            yield np.concatenate((end, (1.0, 0.0, 0.0, 0.0))), "sphere", radius


def _origin(element: Xml.Element, pose: Array) -> None:
    angles = roll_pitch_yaw(rotations_from_quaternions(pose[3:]))[::-1]
    Xml.SubElement(element, "origin", xyz=_row(pose[:3]), rpy=_row(angles))


def _row(numbers: Array | tuple[float, ...]) -> str:
    return " ".join(repr(float(number) + 0.0) for number in numbers)
