"""URDF trees: links and joints of a file; error messages name the wrong element.

Source:
    The XML specification of URDF, pages joint and link.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml
from xml.parsers import expat

import numpy as np

from teleop_core.base import ParameterError, UnknownNameError, damage_told
from teleop_core.base.ranges import MOST_OF_ARM, RANGES, check, range_of
from teleop_core.kernels import Array, length, product, rotation, rotations_from_quaternions, transform

KINDS = {"revolute": "turn", "continuous": "turn", "prismatic": "slide"}
"""Motion of each movable type of joint."""
UNITS = {"turn": "rad", "slide": "m"}
"""Unit of the coordinate of such a joint."""
_READ = ("link", "joint", "inertial")  # elements in which an unexpanded macro must be reported
_XACRO = "http://www.ros.org/wiki/xacro"
_IGNORED = "ignored_quat_xyzw"  # attribute to which that of a file is renamed whose version does not know it
_UNIT_LENGTH = 0.01  # largest difference of the length of a quaternion from 1, because files have few digits
_ANY = "any size"  # unit of numbers that may be infinite
DRIVE_UNITS = {"effort": {"turn": "N·m", "slide": "N"}, "velocity": {"turn": "rad/s", "slide": "m/s"}}
"""Units of the attributes of a limit that concern the drive."""
Links = Mapping[str, Xml.Element]
ASSUMED = {"turn": 2.0 * math.pi, "slide": RANGES["m"].usual}
"""Assumed limit [rad, m] in both directions for a joint without limits."""


@dataclass(frozen=True, kw_only=True)
class UrdfJoint:
    """A joint of a file; ``axis`` a unit vector (3,) in its own frame, None if it is fixed."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array | None
    element: Xml.Element


def root_of(path: Path, data: bytes) -> Xml.Element:
    """Root of a URDF.

    Args:
        path: Path of the file, for messages.
        data: XML of the file.

    Raises:
        RecordingError: ``data`` is not XML.
        ParameterError: The file is not a URDF, or declares a document type.
    """
    with damage_told(path):
        root = tree_of(data)
    if root.tag != "robot":
        raise ParameterError(str(path), f"<{root.tag}>", "a <robot>")
    elements = (*root, *(inner for kind in _READ for element in root.iter(kind) for inner in element))
    named = {name.removeprefix("xmlns:") for name, value in root.attrib.items() if value == _XACRO} | {"xacro"}
    if macros := [element.tag for element in elements if element.tag.partition(":")[0] in named]:
        raise ParameterError(str(path), f"<{macros[0]}>", "without macros; call it .xacro to have it expanded")
    if root.get("version", "1.0").strip() in {"1", "1.0"}:
        for origin in root.iter("origin"):
            if (quaternion := origin.attrib.pop("quat_xyzw", None)) is not None:
                origin.set(_IGNORED, quaternion)
    return root


def has_ignored_quaternion(element: Xml.Element) -> bool:
    """Whether an element has an origin with ``quat_xyzw``, which only files of version 1.1 and later may have."""
    return any(origin.get(_IGNORED) is not None for origin in element.iter("origin"))


def tree_of(data: bytes) -> Xml.Element:
    """Root of an XML file, with the names of its tags as they are written.

    Namespaces are not resolved, as in the reader of ROS: extensions for simulators use prefixes that no file declares.

    Raises:
        ParseError: ``data`` is not XML.
        ParameterError: ``data`` declares a document type; it is refused, so that no entity can expand.
    """
    builder, parser = Xml.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, _refuse_doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise Xml.ParseError(str(error)) from error
    return builder.close()


def _refuse_doctype(name: str, *_: object) -> None:
    """Refuse a document type before anything it declares is used."""
    raise ParameterError("<!DOCTYPE>", name, "left out: a URDF declares no entities")


def elements_of(root: Xml.Element, tag: str) -> dict[str, Xml.Element]:
    """Elements of a kind by their names."""
    found: dict[str, Xml.Element] = {}
    for element in root.findall(tag):
        name = element.get("name", "")
        if not name or name in found:
            raise ParameterError(f"{tag} name", name, f"a name that no other {tag} has")
        found[name] = element
    if not found:
        raise ParameterError(tag, 0, f"at least one <{tag}>")
    return found


def joint_of(name: str, element: Xml.Element, links: Links) -> UrdfJoint:
    """Joint of an element.

    Raises:
        UnknownNameError: The type of the joint, or a link that it names, does not exist.
        ParameterError: The axis has length zero, or a value is not a number.
    """
    kind, axis = element.get("type", ""), None
    if kind not in (*KINDS, "fixed"):
        raise UnknownNameError(f"type of joint {name}", kind, (*KINDS, "fixed"))
    ends = []
    for end in ("parent", "child"):
        found = element.find(end)
        link = "" if found is None else found.get("link", "")
        if link not in links:
            raise UnknownNameError(f"{end} of joint {name}", link, links)
        ends.append(link)
    if kind != "fixed":
        given = numbers_of(f"axis of joint {name}", element.find("axis"), "xyz", (1.0, 0.0, 0.0))
        norm = float(length(given))
        if norm < 1e-9:
            raise ParameterError(f"axis of joint {name}", given.tolist(), "longer than 0")
        axis = given / norm
    origin = origin_of(f"joint {name}", element)
    return UrdfJoint(name=name, kind=kind, parent=ends[0], child=ends[1], origin=origin, axis=axis, element=element)


def joints_by_child(joints: list[UrdfJoint]) -> dict[str, UrdfJoint]:
    """For each link except the root, the joint whose child it is."""
    found: dict[str, UrdfJoint] = {}
    for joint in joints:
        if joint.child in found:
            both = [found[joint.child].name, joint.name]
            raise ParameterError(f"link {joint.child}", both, "the child of one joint")
        found[joint.child] = joint
    return found


def root_link(links: Links, by_child: Mapping[str, UrdfJoint]) -> str:
    """The only link that is not the child of a joint; cycles and several roots are refused."""
    for link in links:
        chain_to(link, by_child)
    roots = [name for name in links if name not in by_child]
    if len(roots) != 1:
        raise ParameterError("links that are no child", roots, "one, the base")
    return roots[0]


def tip_of(tip: str, links: Links, joints: list[UrdfJoint]) -> str:
    """Tip link: the link of the given name, or the only link without a child."""
    if tip:
        if tip not in links:
            raise UnknownNameError("tip", tip, links)
        return tip
    parents = {joint.parent for joint in joints}
    ends = [name for name in links if name not in parents]
    if len(ends) != 1:
        raise ParameterError("tip", "", f"one of {', '.join(ends)}, or another link")
    return ends[0]


def chain_to(tip: str, by_child: Mapping[str, UrdfJoint]) -> list[UrdfJoint]:
    """Joints from the root to a link."""
    found: list[UrdfJoint] = []
    link = tip
    while link in by_child:
        found.append(by_child[link])
        link = found[-1].parent
        if len(found) > len(by_child):
            raise ParameterError(f"joint {found[-1].name}", link, "a parent that is not its own descendant")
    return found[::-1]


def limits_of(joint: UrdfJoint) -> tuple[float, float]:
    """Lower and upper limit of a joint [rad, m], narrowed to the soft limits of the joint's controller.

    Raises:
        ParameterError: The joint has no limits and is not continuous, or its lower limit is above the upper limit, or a
            limit is not physical.
    """
    most = ASSUMED[KINDS[joint.kind]]
    if is_endless(joint):
        lower, upper = -most, most
    else:
        lower, upper = ends_of(joint, "limit", "lower", "upper")
        if joint.element.find("limit") is None or lower == upper == 0.0:
            name = f"<limit> of joint {joint.name}"
            needed = "given, with lower < upper; a joint without limits must have the type continuous"
            raise ParameterError(name, "missing", needed)
        lower = -most if lower < -MOST_OF_ARM else lower
        upper = most if upper > MOST_OF_ARM else upper
    if soft := soft_limits_of(joint):
        lower, upper = max(lower, soft[0]), min(upper, soft[1])
    if not lower < upper:
        raise ParameterError(f"limits of joint {joint.name}", (lower, upper), "lower < upper")
    return lower, upper


def is_endless(joint: UrdfJoint) -> bool:
    """Whether a joint is continuous, or has limits so large that they mean no limits."""
    lower, upper = ends_of(joint, "limit", "lower", "upper")
    return joint.kind == "continuous" or min(-lower, upper) > MOST_OF_ARM


def soft_limits_of(joint: UrdfJoint) -> tuple[float, float] | None:
    """Soft limits [rad, m] of the joint's controller; None where the file contains none."""
    lower, upper = ends_of(joint, "safety_controller", "soft_lower_limit", "soft_upper_limit")
    return (lower, upper) if lower < upper else None


def ends_of(joint: UrdfJoint, tag: str, lower: str, upper: str) -> tuple[float, float]:
    """Two coordinates [rad, m] from the attributes of a joint's element; 0 for a missing attribute."""
    element = joint.element.find(tag)
    first, second = (float(numbers_of(f"joint {joint.name}", element, k, (0.0,), _ANY)[0]) for k in (lower, upper))
    return first, second


def drive_limit_of(joint: UrdfJoint, key: str) -> float:
    """Effort or speed limit of a joint from its element ``limit``; infinite if it is larger than that of any drive.

    Args:
        joint: The joint.
        key: ``effort`` [N·m, N] or ``velocity`` [rad/s, m/s]; 0 if the file does not contain it.

    Raises:
        ParameterError: The limit is not a number, or negative.
    """
    where, unit = f"joint {joint.name}", DRIVE_UNITS[key][KINDS[joint.kind]]
    value = float(numbers_of(where, joint.element.find("limit"), key, (0.0,), _ANY)[0])
    if value < 0.0:
        raise ParameterError(f"{key} of {where}", value, ">= 0")
    return value if value <= range_of(unit).most else math.inf


def turn_of_z(axis: Array) -> tuple[float, Array]:
    """Sign of the z component of an axis, and the rotation (4, 4) that turns z into the axis times that sign."""
    sign = -1.0 if axis[2] < 0.0 else 1.0
    return sign, transform(_turned_z(sign * axis), np.zeros(3))


def _turned_z(axis: Array) -> Array:
    """Shortest rotation (3, 3) that turns z into a unit vector (3,) with z >= 0."""
    x, y, z = axis.tolist()
    share = 1.0 / (1.0 + z)
    return np.array([[1.0 - x * x * share, -x * y * share, x], [-x * y * share, 1.0 - y * y * share, y], [-x, -y, z]])


def origin_of(where: str, element: Xml.Element) -> Array:
    """Transform (4, 4) of the origin of an element; ``where`` is the name of the element in an error message."""
    found = element.find("origin")
    turn = _turn_of(where, found)
    place = numbers_of(where, found, "xyz", (0.0, 0.0, 0.0), "m")
    if max(map(abs, place.tolist())) > MOST_OF_ARM:
        needed = f"within {MOST_OF_ARM:g} m in each direction; put the arm near its root"
        raise ParameterError(f"origin of {where}", place.tolist(), needed)
    return transform(turn, place)


def _turn_of(where: str, origin: Xml.Element | None) -> Array:
    """Rotation (3, 3) of an origin, from its ``rpy`` or its ``quat_xyzw``."""
    roll, pitch, yaw = numbers_of(where, origin, "rpy", (0.0, 0.0, 0.0), "rad").tolist()
    if origin is None or origin.get("quat_xyzw") is None:
        return product(product(rotation("z", yaw), rotation("y", pitch)), rotation("x", roll))
    if origin.get("rpy") is not None:
        raise ParameterError(f"quat_xyzw of {where}", origin.get("quat_xyzw"), "the only rotation; it has rpy too")
    quaternion = numbers_of(where, origin, "quat_xyzw", (0.0, 0.0, 0.0, 1.0))
    size = float(length(quaternion))
    if abs(size - 1.0) > _UNIT_LENGTH:
        raise ParameterError(f"quat_xyzw of {where}", origin.get("quat_xyzw"), "a quaternion x y z w of length 1")
    return rotations_from_quaternions(quaternion[[3, 0, 1, 2]] / size)


def numbers_of(where: str, element: Xml.Element | None, key: str, default: tuple[float, ...], unit: str = "") -> Array:
    """Numbers of an attribute, or the default where element or attribute is missing.

    Args:
        where: Name of the element with the attribute, for the error.
        element: The element.
        key: Name of the attribute.
        default: Default values; their number is the required number.
        unit: Unit of the numbers, a key of :data:`~teleop_core.base.ranges.RANGES`, which contains their bounds.

    Raises:
        ParameterError: The number of words is wrong, a word is not a number, or a value is not physical.
    """
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(default)
    found = np.array([_number(word) for word in text.split()])
    is_number = ~np.isnan(found) if unit == _ANY else np.isfinite(found)
    if len(found) != len(default) or not is_number.all():
        wanted = f"{len(default)} finite numbers" if len(default) > 1 else "a finite number"
        raise ParameterError(f"{key} of {where}", text, wanted)
    for value in found.tolist() if unit != _ANY else ():
        check(f"{key} of {where}", value, unit)
    return found


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan
