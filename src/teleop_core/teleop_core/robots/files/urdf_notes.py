"""Notes on a URDF: content that may be read differently from the author's intention."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from teleop_core.base.ranges import MOST_OF_ARM, unusual
from teleop_core.kernels.portable import length
from teleop_core.robots.files import urdf_tree


def notes_on(chain: Sequence[urdf_tree.UrdfJoint], links: urdf_tree.Links) -> Iterator[str]:
    """Lines on the joints between root and tip, and on all links.

    Args:
        chain: Joints between root and tip.
        links: Elements of the links by their names.
    """
    moving = [joint for joint in chain if joint.axis is not None]
    yield from _listed("narrowed to the soft limits of its safety_controller", moving, _is_narrowed)
    endless = [joint for joint in moving if joint.kind == "continuous"]
    yield from _listed("lower and upper are ignored: the joint is continuous", endless, _has_limits)
    for kind, unit in urdf_tree.UNITS.items():
        yield from _of_kind([joint for joint in moving if urdf_tree.KINDS[joint.kind] == kind], kind, unit)
    yield from _told("origins", chain, [float(length(j.origin[:3, 3])) for j in chain], "m")
    turned = [*((f"joint {j.name}", j.element) for j in chain), *((f"link {name}", e) for name, e in links.items())]
    if ignored := [name for name, element in turned if urdf_tree.has_ignored_quaternion(element)]:
        yield f'quat_xyzw of {", ".join(ignored)} is ignored: it needs <robot version="1.1">'
    for name, link in links.items():
        tensor = link.find("inertial/inertia")
        keys = ("ixx", "iyy", "izz")
        if min(float(urdf_tree.numbers_of(name, tensor, key, (0.0,), "kg·m²")[0]) for key in keys) < 0.0:
            yield f"link {name} has a negative inertia, which no body has"


def _of_kind(moving: Sequence[urdf_tree.UrdfJoint], kind: str, unit: str) -> Iterator[str]:
    """Lines on the limits of the joints of one kind of motion."""
    bounded = [joint for joint in moving if joint.kind != "continuous"]
    what = f"limits beyond {MOST_OF_ARM:g} {unit} count as no limits; {urdf_tree.ASSUMED[kind]:.3g} {unit} are assumed"
    yield from _listed(what, bounded, lambda joint: _widest(joint) > MOST_OF_ARM)
    near = [joint for joint in bounded if _widest(joint) <= MOST_OF_ARM]
    yield from _told("limits", near, list(map(_widest, near)), unit)
    for key in urdf_tree.DRIVE_UNITS:
        unknown = f"{key} is beyond that of any drive and counts as unknown"
        yield from _listed(unknown, moving, partial(_is_beyond, key))
    driven = [joint for joint in bounded if not _is_beyond("velocity", joint)]
    yield from _told("speeds", driven, [urdf_tree.drive_limit_of(j, "velocity") for j in driven], f"{unit}/s")


def _listed(
    what: str, joints: Sequence[urdf_tree.UrdfJoint], is_so: Callable[[urdf_tree.UrdfJoint], bool]
) -> Iterator[str]:
    if found := [joint.name for joint in joints if is_so(joint)]:
        yield f"{', '.join(found)}: {what}"


def _is_narrowed(joint: urdf_tree.UrdfJoint) -> bool:
    soft, (lower, upper) = urdf_tree.soft_limits_of(joint), urdf_tree.ends_of(joint, "limit", "lower", "upper")
    if urdf_tree.is_endless(joint):
        upper = urdf_tree.ASSUMED[urdf_tree.KINDS[joint.kind]]
        lower = -upper
    return soft is not None and (soft[0] > lower or soft[1] < upper)


def _widest(joint: urdf_tree.UrdfJoint) -> float:
    return max(map(abs, urdf_tree.ends_of(joint, "limit", "lower", "upper")))


def _has_limits(joint: urdf_tree.UrdfJoint) -> bool:
    return urdf_tree.ends_of(joint, "limit", "lower", "upper") != (0.0, 0.0)


def _is_beyond(key: str, joint: urdf_tree.UrdfJoint) -> bool:
    return urdf_tree.drive_limit_of(joint, key) == math.inf


def _told(what: str, joints: Sequence[urdf_tree.UrdfJoint], values: Sequence[float], unit: str) -> Iterator[str]:
    if found := unusual([joint.name for joint in joints], values, unit):
        yield f"{what} of {found}"
