"""Transform chain: poses of a frame in one that others carry, composed of those between them."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.kernels.geometry import Array, quaternion_products, rotations_from_quaternions
from teleop_core.kernels.portable import length
from teleop_exchange.bag_messages import Frames, Rows
from teleop_exchange.times import Stamps


def chain_to(top: str, frame: str, parents: Mapping[str, Collection[str]]) -> list[Frames]:
    """Parent and child of each transform from a frame up to another; at least one.

    Args:
        top: The other frame; empty for the one that nothing carries.
        frame: The frame.
        parents: All frames in which each frame is told.

    Raises:
        UnknownNameError: No other frame is said, and one on the way is told in several.
        ParameterError: A frame carries itself.
    """
    ways: dict[str, list[Frames]] = {frame: []}
    for name in (queue := [frame]):
        own = parents.get(name, ())
        if not top and len(own) > 1:
            raise UnknownNameError(f"--parent (poses of {name} stand in several)", "", sorted(own))
        for parent in sorted(own):
            if not top and parent in ways:
                raise ParameterError("--frame", frame, f"a frame that is not its own ancestor; {parent} is one")
            if parent not in ways:
                ways[parent] = [*ways[name], (parent, name)]
                queue.append(parent)
    return ways.get(top or queue[-1]) or [(top, frame)]


def composed(edges: Sequence[Rows], *, by_log: bool) -> Rows:
    """Poses of the first transform's child in the last one's parent.

    They have the times of the transform with most poses. Of each other one the newest pose that is
    not later counts, and a single one at all times. Poses before the first of any are left out.

    Args:
        edges: Poses of each transform, that of the frame itself first; the child of each is the
            parent of the one before.
        by_log: Whether the time of a pose is that of recording; it is so too where the stamps of a
            transform never change.
    """
    moving = [edge for edge in edges if len(edge.poses) > 1]
    is_log = by_log or any((edge.stamp_ns == edge.stamp_ns[0]).all() for edge in moving)
    fastest = max(edges, key=lambda edge: len(edge.poses))
    times, is_there = _times(fastest, is_log), np.ones(len(fastest.poses), np.bool_)
    product = np.zeros((len(times), 7))
    product[:, 3] = 1.0
    for edge in edges:
        rows = np.arange(len(times))
        if len(edge.poses) == 1:
            rows[:] = 0
        elif edge is not fastest:
            own = _times(edge, is_log)
            order = np.argsort(own, kind="stable")
            found = np.searchsorted(own[order], times, side="right") - 1
            is_there &= found >= 0
            rows = order[np.maximum(found, 0)]
        product = _carried(edge.poses[rows], product)
    return Rows(fastest.stamp_ns[is_there], fastest.log_ns[is_there], product[is_there])


def _times(rows: Rows, is_log: bool) -> Stamps:
    return rows.log_ns if is_log else rows.stamp_ns


def _carried(carriers: Array, poses: Array) -> Array:
    """Poses (n, 7) in frames that have poses themselves (n, 7); NaN where a carrier has no turn."""
    size = length(carriers[:, 3:])[:, None]
    turns = carriers[:, 3:] / np.where(size > 0.0, size, np.nan)
    moved = (rotations_from_quaternions(turns) * poses[:, None, :3]).sum(axis=-1)
    quaternions = quaternion_products(carriers[:, 3:], poses[:, 3:])
    return np.concatenate((carriers[:, :3] + moved, quaternions), axis=1)
