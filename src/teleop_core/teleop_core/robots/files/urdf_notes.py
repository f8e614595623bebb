"""Notes on a URDF: content that may be read differently from the author's intention."""

from collections.abc import Callable, Iterator, Sequence

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
    bounded = [joint for joint in moving if joint.kind != "continuous"]
    yield from _listed("narrowed to the soft limits of its safety_controller", bounded, _is_narrowed)
    endless = [joint for joint in moving if joint.kind == "continuous"]
    yield from _listed("lower and upper are ignored: the joint is continuous", endless, _has_limits)
    for kind, unit in urdf_tree.UNITS.items():
        own = [joint for joint in bounded if urdf_tree.KINDS[joint.kind] == kind]
        what = (
            f"limits beyond {MOST_OF_ARM:g} {unit} count as no limits; {urdf_tree.ASSUMED[kind]:.3g} {unit} are assumed"
        )
        yield from _listed(what, own, lambda joint: _widest(joint) > MOST_OF_ARM)
        near = [joint for joint in own if _widest(joint) <= MOST_OF_ARM]
        yield from _told("limits", near, list(map(_widest, near)), unit)
        speeds = [_speed(joint, unit) for joint in own]
        yield from _told("speeds", own, speeds, f"{unit}/s")
    yield from _told("origins", chain, [float(length(j.origin[:3, 3])) for j in chain], "m")
    for name, link in links.items():
        tensor = link.find("inertial/inertia")
        keys = ("ixx", "iyy", "izz")
        if min(float(urdf_tree.numbers_of(name, tensor, key, (0.0,), "kg·m²")[0]) for key in keys) < 0.0:
            yield f"link {name} has a negative inertia, which no body has"


def _listed(
    what: str, joints: Sequence[urdf_tree.UrdfJoint], is_so: Callable[[urdf_tree.UrdfJoint], bool]
) -> Iterator[str]:
    if found := [joint.name for joint in joints if is_so(joint)]:
        yield f"{', '.join(found)}: {what}"


def _is_narrowed(joint: urdf_tree.UrdfJoint) -> bool:
    soft, (lower, upper) = urdf_tree.soft_limits_of(joint), urdf_tree.ends_of(joint, "limit", "lower", "upper")
    return soft is not None and (soft[0] > lower or soft[1] < upper)


def _widest(joint: urdf_tree.UrdfJoint) -> float:
    return max(map(abs, urdf_tree.ends_of(joint, "limit", "lower", "upper")))


def _has_limits(joint: urdf_tree.UrdfJoint) -> bool:
    return urdf_tree.ends_of(joint, "limit", "lower", "upper") != (0.0, 0.0)


def _speed(joint: urdf_tree.UrdfJoint, unit: str) -> float:
    limit = joint.element.find("limit")
    return float(urdf_tree.numbers_of(joint.name, limit, "velocity", (0.0,), f"{unit}/s")[0])


def _told(what: str, joints: Sequence[urdf_tree.UrdfJoint], values: Sequence[float], unit: str) -> Iterator[str]:
    if found := unusual([joint.name for joint in joints], values, unit):
        yield f"{what} of {found}"
