"""Transform chain: poses of a frame in an indirect parent frame, composed of the transforms between the two frames."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.kernels.geometry import Array, quaternion_products, rotations_from_quaternions
from teleop_core.kernels.portable import length
from teleop_exchange.bag_messages import Frames, Rows
from teleop_exchange.times import LARGEST_LAG_NS, Stamps, clock_offset


def chain_to(top: str, frame: str, parents: Mapping[str, Collection[str]]) -> list[Frames]:
    """Parent and child of each transform from a frame up to the frame ``top``; at least one transform.

    Args:
        top: The upper frame; empty for the frame without a parent.
        frame: The frame at which the chain begins.
        parents: All parent frames of each frame.

    Raises:
        UnknownNameError: ``top`` is empty, and a frame of the chain has several parents.
        ParameterError: A frame is its own ancestor.
    """
    ways: dict[str, list[Frames]] = {frame: []}
    for name in (queue := [frame]):
        own = parents.get(name, ())
        if not top and len(own) > 1:
            raise UnknownNameError(f"--parent (poses of {name} stand in several)", "", sorted(own))
        for parent in sorted(own):
            if not top and parent in ways:
                raise ParameterError(
                    "--frame", frame, f"a frame of a tree without a cycle; {parent} is its own ancestor"
                )
            if parent not in ways:
                ways[parent] = [*ways[name], (parent, name)]
                queue.append(parent)
    return ways.get(top or queue[-1]) or [(top, frame)]


def composed(edges: Sequence[Rows], *, by_log: bool) -> Rows:
    """Poses of the first transform's child in the last transform's parent.

    The times of the result are those of the transform with the most poses. At each time, the newest pose of each other
    transform is used; a transform with a single pose is constant. Times before the first pose of any transform are left
    out.

    Args:
        edges: Poses of each transform, the transform of the frame itself first; the child of each transform is the
            parent of the previous one.
        by_log: Whether the time of recording is used as the time of a pose. It is always used if the stamps of a
            transform never change, or if the transforms are stamped by different clocks.
    """
    moving = [edge for edge in edges if len(edge.poses) > 1]
    offsets = [clock_offset(edge.stamp_ns, edge.log_ns) for edge in moving]
    is_log = by_log or any((edge.stamp_ns == edge.stamp_ns[0]).all() for edge in moving)
    is_log |= bool(offsets) and max(offsets) - min(offsets) > LARGEST_LAG_NS
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
    """Transform poses (n, 7) by the poses ``carriers`` (n, 7) of their frames; NaN for an invalid rotation."""
    size = length(carriers[:, 3:])[:, None]
    turns = carriers[:, 3:] / np.where(size > 0.0, size, np.nan)
    moved = (rotations_from_quaternions(turns) * poses[:, None, :3]).sum(axis=-1)
    quaternions = quaternion_products(carriers[:, 3:], poses[:, 3:])
    return np.concatenate((carriers[:, :3] + moved, quaternions), axis=1)
