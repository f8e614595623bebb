"""Robots from URDF: the chain from the root link to a tip, with the drive data of the file.

The joints between root and tip move the tip. All other joints stay at zero, but their links have mass; the jaw moves
those of a gripper in pictures (:mod:`teleop_core.robots.files.grippers`). A joint between
root and tip that mimics another joint moves with it (:mod:`teleop_core.robots.dynamics.followers`). The kinematics are
those of Denavit-Hartenberg chains (:mod:`teleop_core.kinematics.dh_kernels`), the dynamics those of rigid bodies
(:mod:`teleop_core.robots.dynamics.chain_dynamics`). Effort and velocity limits, damping and friction of the file are
used for the drives if they are above zero. The inertia of a drive is that of the links at home; a URDF never contains
the inertia of its motor. A file of drives may state the inertia of the motor and other missing values. Values that are
missing there too are assumed, as for tables (:mod:`teleop_core.robots.arms.dh_drives`), and ``Robot.drives.assumed``
names them. Meshes are read when they are drawn (:mod:`teleop_core.robots.bodies.looks`).

Source:
    The XML specification of URDF, pages joint and link.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from teleop_core.base import ParameterError, UnknownNameError
from teleop_core.kernels import Array, dot, length, product
from teleop_core.kinematics import DIRECTIONS
from teleop_core.kinematics.closed_form.decomposition import SEARCH, solution_of
from teleop_core.robots.arms import dh_chain, dh_drives
from teleop_core.robots.drives import ENTRIES, Drives, Dynamics
from teleop_core.robots.dynamics.chain_dynamics import body_row, chain_dynamics, chain_row
from teleop_core.robots.dynamics.followers import Follower, Followers, dynamics_row, follower_dynamics, follower_inertia
from teleop_core.robots.files import urdf_notes, urdf_tree, xacro_files
from teleop_core.robots.files.grippers import strokes_of
from teleop_core.robots.files.visuals import colors_of, visuals_of
from teleop_core.robots.rank import directions_of
from teleop_core.robots.robot import Robot

MODELS = ("independent", "links")
"""Choices for the dynamics of a URDF's arm; see :func:`load_urdf`."""
_ROUNDING = 1e-6  # tolerance of an inertia, divided by its trace, because files have few digits
_NO_MASS = 1e-6  # less mass or inertia counts as none; files contain it because simulators need some [kg, kg·m²]
_NO_INERTIA = 1e-9  # a smaller inertia is rounding of bodies on the axis and counts as unknown [kg·m² or kg]
_POWERS = {"viscous": 2, "coulomb": 1}  # a follower adds its friction times its factor to this power


def load_urdf(
    path: Path | str,
    arguments: Mapping[str, str] | None = None,
    *,
    tip: str = "",
    task: str = "",
    dynamics: str = "independent",
    drives: str = "",
) -> Robot:
    """Robot with the joints between the root of a URDF and a tip.

    Args:
        path: The file; a file whose name ends in ``.xacro`` is expanded by the package ``xacro``.
        arguments: Texts for the ``<xacro:arg>`` of a xacro, by their names.
        tip: Link whose frame is the tip; empty for the only link without a child.
        task: Directions that the arm controls, of :data:`DIRECTIONS`, separated by blanks or commas. Empty means all
            six, or the directions of :func:`~teleop_core.robots.rank.directions_of` for an arm that cannot move in all
            six at once.
        dynamics: One of :data:`MODELS`. "independent" means independent axes with balanced gravity. "links" means the
            bodies of the file, with mass and dynamic coupling; the controller feeds their gravity forward.
        drives: YAML file with the drives of the joints, by joint names, with the entries of
            :class:`~teleop_core.robots.drives.Drives`; its values override those of the URDF. Its entry ``inertia`` is
            that of the motor alone; the inertia of the links is added.

    Returns:
        The robot; its base is the root link. Its inverse kinematics are in closed form if it belongs to a class of
        :mod:`~teleop_core.kinematics.closed_form.decomposition`, else by search. Home is zero, or the middle of the
        limits if zero is outside them. Continuous joints get the assumed limits ±2π.

    Raises:
        RecordingError: The file cannot be read, or is not XML.
        ParameterError: An element is missing or impossible; the message names it. With the dynamics "links", also if a
            joint outside the path to the tip follows a joint on the path.
        UnknownNameError: There is no tip, direction, dynamics, link, type of joint, argument of the xacro, joint of the
            drives or entry of the drives with a given name.
        TeleopError: The package ``xacro`` is needed but not installed.
    """
    if dynamics not in MODELS:
        raise UnknownNameError("dynamics", dynamics, MODELS)
    root = urdf_tree.root_of(Path(path), xacro_files.xml_of(Path(path), arguments or {}))
    links = urdf_tree.elements_of(root, "link")
    joints = [
        urdf_tree.joint_of(name, element, links) for name, element in urdf_tree.elements_of(root, "joint").items()
    ]
    by_child = urdf_tree.joints_by_child(joints)
    base = urdf_tree.root_link(links, by_child)
    end = urdf_tree.tip_of(tip, links, joints)
    chain = urdf_tree.chain_to(end, by_child)
    moving = [joint for joint in chain if joint.axis is not None]
    if not moving:
        movable = ", ".join(joint.child for joint in joints if joint.axis is not None)
        others = f"joints move {movable}" if movable else "no joint of the file moves"
        needed = f"a link that moves: a joint must lie between it and the root {base!r}; {others}"
        raise ParameterError("tip", end, needed)
    trains, followers = _trains(moving, {joint.name: joint for joint in joints})
    leaders = [train[0].joint for train in trains]
    limits = [_narrowed(train) for train in trains]
    fixed, kinds = _frames(chain)
    reach = sum(float(length(joint.origin[:3, 3])) for joint in chain)
    reach += sum(max(map(abs, urdf_tree.limits_of(j))) for j in moving if j.kind == "prismatic")
    home, n = np.array([limit.home for limit in limits]), len(limits)
    may_be_any = dynamics == "independent"  # the inertia then counts as assumed
    bodies, inertia = _bodies(moving, base, links, joints, may_be_any), np.zeros((n, n))
    chain_numbers = chain_row(kinds, fixed, bodies, np.zeros(len(moving)))
    follower_inertia(home, dynamics_row(followers, chain_numbers, np.zeros(n)), inertia)
    table = _drives(trains, np.diag(inertia).tolist(), str(drives))
    make = partial(
        dh_chain.chain_robot,
        name=root.get("name") or Path(path).stem,
        joints=limits,
        kinds=kinds,
        fixed=fixed,
        reach=reach,
        drives=table,
        followers=None if followers.is_plain else followers,
    )
    controlled = _task(task) or directions_of(make(task=DIRECTIONS), reach / math.pi).best
    solution = solution_of(kinds, fixed, reach, controlled) if followers.is_plain else SEARCH
    robot = make(task=controlled, solution=solution)
    coordinates = dict(zip((j.name for j in moving), followers.of(home).tolist(), strict=True))
    named = {joint.name: joint for joint in joints}
    strokes = strokes_of(chain, joints, links, by_child, partial(_leader, named=named))
    visuals, undrawn = visuals_of(coordinates, links, by_child, Path(path), colors_of(root), strokes)
    # The start posture is not computed here, because its search takes about one second. It is computed at its first
    # use.
    notes = (*urdf_notes.notes_on(chain, links), *undrawn)
    robot = replace(robot, visuals=visuals, notes=notes, home_is_assumed=True, start=None)
    if dynamics == "independent":
        return robot
    motors = np.maximum(table.inertia - np.diag(inertia), 0.0)
    if followers.is_plain:
        model = chain_dynamics(chain_row(kinds, fixed, bodies, motors))
    else:
        _refuse_beside(leaders, moving, joints)
        model = follower_dynamics(dynamics_row(followers, chain_numbers, motors), n)
    _refuse_weak(leaders, table, home, model)
    return replace(robot, dynamics=model, start=None)


@dataclass(frozen=True, kw_only=True)
class _Geared:
    """A joint whose coordinate is ``factor`` times that of its leader, plus ``offset``."""

    joint: urdf_tree.UrdfJoint
    factor: float = 1.0
    offset: float = 0.0


def _trains(
    moving: list[urdf_tree.UrdfJoint], named: Mapping[str, urdf_tree.UrdfJoint]
) -> tuple[list[list[_Geared]], Followers]:
    """For each joint of the robot, the joint and its followers on the path to the tip; also all motions."""
    trains: dict[str, list[_Geared]] = {}
    motions = []
    for joint in moving:
        leader, factor, offset = _leader(joint, named)
        train = trains.setdefault(leader.name, [_Geared(joint=leader)])
        if joint is not leader:
            train.append(_Geared(joint=joint, factor=factor, offset=offset))
        place = list(trains).index(leader.name)
        motions.append(Follower(leader=place, factor=factor, offset=offset))
    kinds = tuple(1.0 if urdf_tree.KINDS[t[0].joint.kind] == "turn" else 2.0 for t in trains.values())
    return list(trains.values()), Followers(motions=tuple(motions), kinds=kinds)


def _leader(
    joint: urdf_tree.UrdfJoint, named: Mapping[str, urdf_tree.UrdfJoint]
) -> tuple[urdf_tree.UrdfJoint, float, float]:
    """Leader at the end of the mimic chain of a joint, or the joint itself, with factor and offset."""
    factor, offset, passed = 1.0, 0.0, [joint.name]
    while (mimic := joint.element.find("mimic")) is not None:
        where = f"mimic of joint {joint.name}"
        own = float(urdf_tree.numbers_of(where, mimic, "multiplier", (1.0,))[0])
        if own == 0.0:
            raise ParameterError(
                f"multiplier of {where}", own, "not 0; a joint that never moves must have the type fixed"
            )
        unit = urdf_tree.UNITS[urdf_tree.KINDS[joint.kind]]
        offset += factor * float(urdf_tree.numbers_of(where, mimic, "offset", (0.0,), unit)[0])
        factor, name = factor * own, mimic.get("joint", "")
        movable = [other for other in named if named[other].axis is not None]
        if name not in movable:
            raise UnknownNameError(where, name, movable)
        if name in passed:
            raise ParameterError(where, name, "a joint that does not itself follow this joint")
        joint = named[name]
        passed.append(name)
    return joint, factor, offset


def _refuse_beside(
    leaders: list[urdf_tree.UrdfJoint], moving: list[urdf_tree.UrdfJoint], joints: list[urdf_tree.UrdfJoint]
) -> None:
    """Refuse joints outside the chain that follow a joint of the robot, because their moving links have mass."""
    named = {joint.name: joint for joint in joints}
    for joint in joints:
        if joint.axis is not None and joint not in moving and _leader(joint, named)[0] in leaders:
            needed = f"independent: joint {joint.name} moves too, but is not on the path to the tip"
            raise ParameterError("dynamics", "links", needed)


def _refuse_weak(leaders: list[urdf_tree.UrdfJoint], drives: Drives, home: Array, model: Dynamics) -> None:
    """Refuse drives that cannot hold the arm at home."""
    weight = np.zeros(len(leaders))
    model.gravity(home, model.parameters.copy(), weight)
    for joint, most, needed in zip(leaders, drives.effort_limit, abs(weight), strict=True):
        if most <= needed:
            name = f"effort of joint {joint.name}"
            raise ParameterError(name, float(most), f"above {needed:.3g}, its load at home")


def _task(task: str) -> tuple[str, ...]:
    names = tuple(str(task).replace(",", " ").split())
    for name in names:
        if name not in DIRECTIONS:
            raise UnknownNameError("task", name, DIRECTIONS)
    return names


def _narrowed(train: list[_Geared]) -> dh_chain.DhJoint:
    """Joint with limits narrowed so that it and all its followers stay within their own limits."""
    leader = train[0].joint
    lower, upper = urdf_tree.limits_of(leader)
    for geared in train[1:]:
        if not urdf_tree.is_endless(geared.joint):
            ends = sorted((x - geared.offset) / geared.factor for x in urdf_tree.limits_of(geared.joint))
            lower, upper = max(lower, ends[0]), min(upper, ends[1])
    if not lower < upper:
        names = ", ".join(geared.joint.name for geared in train[1:])
        needed = f"lower < upper within the limits of {names}, which follow this joint"
        raise ParameterError(f"limits of joint {leader.name}", (lower, upper), needed)
    home = 0.0 if lower <= 0.0 <= upper else 0.5 * (lower + upper)
    return dh_chain.DhJoint(name=leader.name, symbol="", sign=1.0, lower=lower, upper=upper, home=home)


def _frames(chain: list[urdf_tree.UrdfJoint]) -> tuple[list[Array], list[float]]:
    """Constant transforms between the joints, with the joint axes along z, and the kind of each joint."""
    fixed, kinds, last = [], [], np.eye(4)
    for joint in chain:
        last = product(last, joint.origin)
        if joint.axis is not None:
            sign, align = urdf_tree.turn_of_z(joint.axis)
            fixed.append(product(last, align))
            kinds.append(sign * (1.0 if urdf_tree.KINDS[joint.kind] == "turn" else 2.0))
            last = np.ascontiguousarray(align.T)
    return [*fixed, last], kinds


def _drives(trains: list[list[_Geared]], inertias: list[float], file: str) -> Drives:
    """Drives of the leaders, with the friction and the speed limits of their followers."""
    kinds, stated = [urdf_tree.KINDS[train[0].joint.kind] for train in trains], {}
    names = [train[0].joint.name for train in trains]
    given = dh_drives.read_drives(Path(file).expanduser(), names, kinds) if file else [{}] * len(trains)
    for train, kind, inertia, drive in zip(trains, kinds, inertias, given, strict=True):
        own: dict[str, float] = {}
        for geared in train:
            factor = abs(geared.factor)
            for entry, value in _drive_entries(geared.joint).items():
                if entry == "speed_limit":
                    own[entry] = min(own.get(entry, math.inf), value / factor)
                elif entry != "effort_limit":
                    own[entry] = own.get(entry, 0.0) + value * math.pow(factor, _POWERS[entry])
                elif geared is train[0]:
                    own[entry] = value
        own |= drive
        least = dh_drives.least_inertia(kind, own.get("viscous", 0.0), own.get("coulomb", 0.0))
        if "inertia" in drive:
            own["inertia"] = inertia + drive["inertia"]
        elif max(inertia, least) > _NO_INERTIA:
            own["inertia"] = max(inertia, least)
        stated[train[0].joint.name] = own
    drives = dh_drives.drives_of(kinds, dh_drives.parse_drives(stated, names, kinds, 1.0))
    motors = ("inertia",) * any("inertia" not in drive for drive in given)
    assumed = tuple(name for name in ENTRIES if name in (*motors, *drives.assumed))
    return replace(drives, assumed=assumed)


def _drive_entries(joint: urdf_tree.UrdfJoint) -> dict[str, float]:
    place, element = list(urdf_tree.UNITS).index(urdf_tree.KINDS[joint.kind]), joint.element.find("dynamics")
    found = {}
    for key, entry in (("effort", "effort_limit"), ("velocity", "speed_limit")):
        found[entry] = urdf_tree.drive_limit_of(joint, key)
    for key, entry, units in (("damping", "viscous", ("N·m·s/rad", "N·s/m")), ("friction", "coulomb", ("N·m", "N"))):
        where = f"joint {joint.name}"
        found[entry] = float(urdf_tree.numbers_of(where, element, key, (0.0,), units[place])[0])
        if found[entry] < 0.0:
            raise ParameterError(f"{key} of {where}", found[entry], ">= 0")
    # Files with an unknown limit contain 0 or a huge number.
    return {entry: value for entry, value in found.items() if 0.0 < value < math.inf}


def _bodies(
    moving: list[urdf_tree.UrdfJoint],
    base: str,
    links: urdf_tree.Links,
    joints: list[urdf_tree.UrdfJoint],
    may_be_any: bool,
) -> Array:
    """Body of each joint: all links up to the next joint, (n, 13), see :func:`body_row`; other joints are at zero.

    Many files contain inertias that no body can have. Such inertias are accepted if no joint moves the link, or if
    ``may_be_any``.
    """
    carried: dict[str, list[urdf_tree.UrdfJoint]] = {}
    for joint in joints:
        carried.setdefault(joint.parent, []).append(joint)
    places = {joint.name: i for i, joint in enumerate(moving)}
    sums = np.zeros((len(moving), 13))
    stack: list[tuple[str, Array, int]] = [(base, np.eye(4), -1)]
    while stack:
        link, T, mover = stack.pop()
        if mover >= 0:
            mass, inertia, place = _mass(link, links[link], may_be_any)
            centre = product(T, place)
            turned = product(product(centre[:3, :3], inertia), centre[:3, :3].T)
            sums[mover] += body_row(mass, centre[:3, 3], turned)
        for joint in carried.get(link, ()):
            if joint.name in places and joint.axis is not None:
                stack.append((joint.child, urdf_tree.turn_of_z(joint.axis)[1].T, places[joint.name]))
            else:
                stack.append((joint.child, product(T, joint.origin), mover))
    return sums


def _mass(name: str, link: Xml.Element, may_be_any: bool) -> tuple[float, Array, Array]:
    """Mass [kg], inertia (3, 3) [kg·m²] about the centre of mass, and pose of that centre in the link (4, 4)."""
    element, where = link.find("inertial"), f"link {name}"
    if element is None:
        return 0.0, np.zeros((3, 3)), np.eye(4)
    mass = float(urdf_tree.numbers_of(where, element.find("mass"), "value", (0.0,), "kg")[0])
    tensor = element.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        float(urdf_tree.numbers_of(where, tensor, key, (0.0,), "kg·m²")[0])
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if 0.0 <= mass < _NO_MASS and abs(inertia).max() < _NO_MASS:  # a frame to which the file gives a tiny mass
        return 0.0, np.zeros((3, 3)), np.eye(4)
    if mass < 0.0 or not (may_be_any or _is_possible(inertia)):
        needed = "that of a rigid body; dynamics=independent accepts any"
        raise ParameterError(f"inertial of {where}", (mass, inertia.tolist()), needed)
    return mass, inertia, urdf_tree.origin_of(where, element)


def _is_possible(inertia: Array) -> bool:
    """Whether some body has this inertia: no principal moment exceeds the sum of the others.

    This holds if half the trace times I minus the inertia has no negative eigenvalue, and so no negative principal
    minor.
    """
    spread = 0.5 * float(np.trace(inertia))
    if spread == 0.0:
        return not inertia.any()
    M = (np.eye(3) * spread - inertia) / abs(spread)
    minors = [M[i, i] for i in range(3)]
    minors += [M[i, i] * M[j, j] - M[i, j] ** 2 for i, j in combinations(range(3), 2)]
    minors.append(float(dot(M[0], np.cross(M[1], M[2]))))
    return spread > 0.0 and min(minors) >= -_ROUNDING
