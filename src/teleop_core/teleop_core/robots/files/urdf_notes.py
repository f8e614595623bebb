"""Notes on a URDF: what is read of it otherwise than it may be meant."""

from collections.abc import Callable, Iterator, Sequence

from teleop_core.base.ranges import MOST_OF_ARM, unusual
from teleop_core.kernels.portable import length
from teleop_core.robots.files.urdf_tree import (
    ASSUMED,
    KINDS,
    UNITS,
    Links,
    UrdfJoint,
    ends_of,
    numbers_of,
    soft_limits_of,
)


def notes_on(chain: Sequence[UrdfJoint], links: Links) -> Iterator[str]:
    """Lines on the joints between root and tip, and on all links.

    Args:
        chain: These joints.
        links: Elements of the links by their names.
    """
    moving = [joint for joint in chain if joint.axis is not None]
    bounded = [joint for joint in moving if joint.kind != "continuous"]
    yield from _listed("narrowed to the soft limits of its safety_controller", bounded, _is_narrowed)
    endless = [joint for joint in moving if joint.kind == "continuous"]
    yield from _listed("lower and upper left out: it is continuous", endless, _has_limits)
    for kind, unit in UNITS.items():
        own = [joint for joint in bounded if KINDS[joint.kind] == kind]
        what = f"limits beyond {MOST_OF_ARM:g} {unit} mean none; {ASSUMED[kind]:.3g} are assumed"
        yield from _listed(what, own, lambda joint: _widest(joint) > MOST_OF_ARM)
        near = [joint for joint in own if _widest(joint) <= MOST_OF_ARM]
        yield from _told("limits", near, list(map(_widest, near)), unit)
        speeds = [_speed(joint, unit) for joint in own]
        yield from _told("speeds", own, speeds, f"{unit}/s")
    yield from _told("origins", chain, [float(length(j.origin[:3, 3])) for j in chain], "m")
    for name, link in links.items():
        tensor = link.find("inertial/inertia")
        keys = ("ixx", "iyy", "izz")
        if min(float(numbers_of(name, tensor, key, (0.0,), "kg·m²")[0]) for key in keys) < 0.0:
            yield f"link {name} has a negative inertia, which no body has"


def _listed(what: str, joints: Sequence[UrdfJoint], is_so: Callable[[UrdfJoint], bool]) -> Iterator[str]:
    if found := [joint.name for joint in joints if is_so(joint)]:
        yield f"{', '.join(found)}: {what}"


def _is_narrowed(joint: UrdfJoint) -> bool:
    soft, (lower, upper) = soft_limits_of(joint), ends_of(joint, "limit", "lower", "upper")
    return soft is not None and (soft[0] > lower or soft[1] < upper)


def _widest(joint: UrdfJoint) -> float:
    return max(map(abs, ends_of(joint, "limit", "lower", "upper")))


def _has_limits(joint: UrdfJoint) -> bool:
    return ends_of(joint, "limit", "lower", "upper") != (0.0, 0.0)


def _speed(joint: UrdfJoint, unit: str) -> float:
    limit = joint.element.find("limit")
    return float(numbers_of(joint.name, limit, "velocity", (0.0,), f"{unit}/s")[0])


def _told(what: str, joints: Sequence[UrdfJoint], values: Sequence[float], unit: str) -> Iterator[str]:
    if found := unusual([joint.name for joint in joints], values, unit):
        yield f"{what} of {found}"
