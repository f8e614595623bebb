"""Grippers: the joints of a URDF beyond the tip's last joint, as the jaw opens and closes them.

A URDF does not say which joints are a gripper, nor which end of their range is open. Here every joint counts that moves
nothing but links beyond the last joint on the path to the tip. All of them move with the angle of the jaw, joints with
``mimic`` with their leaders. The open end of a joint is the end at which the shapes that it moves are farther from the
tip.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np

from teleop_core.base import TeleopError
from teleop_core.kernels import Array, length, product
from teleop_core.robots.files.urdf_tree import Links, UrdfJoint, chain_to, is_endless, limits_of, origin_of
from teleop_core.robots.files.visuals import place_of

SAMPLES = 31
"""Number of positions of the jaw for which the shapes are placed."""
Lead = tuple[UrdfJoint, float, float]
"""Leader of a joint, with the factor and the offset of the joint's coordinate."""


def strokes_of(
    chain: Sequence[UrdfJoint],
    joints: Sequence[UrdfJoint],
    links: Links,
    by_child: Mapping[str, UrdfJoint],
    leader_of: Callable[[UrdfJoint], Lead],
) -> dict[str, Array]:
    """Coordinates (SAMPLES,) of each joint of a gripper [rad, m] from closed to open, by the names of the joints.

    Args:
        chain: Joints from the root to the tip.
        joints: All joints.
        links: Elements of the links by their names.
        by_child: The joint that carries each link.
        leader_of: Function that returns the leader of a joint, which is the joint itself without ``mimic``.
    """
    last = [joint.name for joint in chain if joint.axis is not None][-1]
    beyond = [j for j in joints if j.axis is not None and last in {one.name for one in chain_to(j.parent, by_child)}]
    trains: dict[str, list[tuple[UrdfJoint, Lead]]] = {}
    for joint in beyond:
        with suppress(TeleopError):  # such a joint stays where it is, as before
            lead = leader_of(joint)
            if lead[0] in beyond and not is_endless(lead[0]):
                trains.setdefault(lead[0].name, []).append((joint, lead))
    found: dict[str, Array] = {}
    for train in trains.values():
        with suppress(TeleopError):
            ends = _ends(train, chain, links, by_child)
            found |= {joint.name: factor * ends + offset for joint, (_, factor, offset) in train}
    return found


def _ends(
    train: Sequence[tuple[UrdfJoint, Lead]], chain: Sequence[UrdfJoint], links: Links, by_child: Mapping[str, UrdfJoint]
) -> Array:
    """Coordinates (SAMPLES,) of a leader from closed to open."""
    lower, upper = limits_of(train[0][1][0])
    tip = place_of(chain, {})[:3, 3]
    far = []
    for value in (lower, upper):
        at = {joint.name: factor * value + offset for joint, (_, factor, offset) in train}
        points = [point for link in links for point in _points(link, links, by_child, at)]
        far.append(float(np.mean([length(point - tip) for point in points])) if points else value)
    closed, opened = (lower, upper) if far[1] >= far[0] else (upper, lower)
    return np.linspace(closed, opened, SAMPLES)


def _points(link: str, links: Links, by_child: Mapping[str, UrdfJoint], at: Mapping[str, float]) -> Iterator[Array]:
    """Places of the shapes of a link that the given joints move."""
    path = chain_to(link, by_child)
    if any(joint.name in at for joint in path):
        T = place_of(path, at)
        for shape in links[link].findall("visual"):
            yield product(T, origin_of(f"visual of link {link}", shape))[:3, 3]
