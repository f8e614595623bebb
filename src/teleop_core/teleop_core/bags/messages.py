"""Messages: the only module that defines the meaning of a message's fields and bytes.

Inside the package a message is a stamp and a row of numbers
(:class:`~teleop_core.graph.topics.Kind` defines the numbers). Three groups of functions convert between both:
:func:`layout` for whole streams and for single messages of a known stream (fast),
:func:`read_values` and :func:`write_values` for messages of any other sender, :func:`report` and
:func:`read_reports` for reports. Quaternions are w, x, y, z in values and x, y, z, w in messages.
"""

import math
from enum import Enum
from typing import Any

import numpy as np

from teleop_core.bags.layouts import SECOND_NS, Layout, Stamps, Values, discover, layout, layout_of
from teleop_core.bags.reports import Report, read_reports, report
from teleop_core.bags.ros_types import deserialise
from teleop_core.graph.topics import Kind

__all__ = [
    "SECOND_NS", "Layout", "Refusal", "Report", "Stamps", "Values", "discover", "layout",
    "layout_of", "read_any", "read_joints", "read_numbers", "read_reports", "read_values", "report",
    "write_values",
]  # fmt: skip

QUATERNION_TOLERANCE = 1e-3
"""Largest difference from 1 of the length of a received quaternion."""
BUTTONS = (0, 1, 2)
"""Indices of clutch, fixture and mode among the buttons of a message."""


class Refusal(Enum):
    """Reason why a live message is not used."""

    NOT_FINITE = "holds NaN or infinite numbers"
    NOT_UNIT = "its quaternion is not of unit length"
    NOT_NEWER = "its stamp is not newer than the last one"
    WRONG_NAMES = "lacks a required name, such as that of a joint of the robot"
    WRONG_LENGTH = "has too few or too many numbers"
    FEW_BUTTONS = (
        "has fewer buttons than joy_buttons names; if it has only a clutch and a mode button, set "
        "joy_buttons=[0, -1, 1]"
    )
    MALFORMED = "has bytes that are no valid message of its type"
    SECOND_PUBLISHER = "is from a second publisher, while the first one sends"
    FLOOD = "came faster than flood_rate allows"


def read_values(
    kind: Kind, message: Any, joint_names: tuple[str, ...] = (), buttons: tuple[int, ...] = BUTTONS
) -> tuple[int, Values] | Refusal:
    """Stamp [ns] and values of any message of a kind, read by attribute.

    Args:
        kind: Kind of the values.
        message: Message of rclpy, or deserialised by rosbags.
        joint_names: Wanted order of the joints; other joints in the message are left out. If empty, all joints are
            returned in the order of the message.
        buttons: Indices of clutch, fixture and mode among the message's buttons; -1 if the message lacks a button.

    Returns:
        Stamp and values, shape (width,); or the reason why the message cannot be used. Velocities or efforts that the
        message leaves empty are NaN.
    """
    stamp = message.header.stamp
    is_joy = kind is Kind.BUTTONS
    values = _pressed(message, buttons) if is_joy else _row(kind, message, joint_names)
    if isinstance(values, Refusal):
        return values
    return stamp.sec * SECOND_NS + stamp.nanosec, np.array(values, dtype=np.float64)


def read_any(
    kind: Kind, data: bytes, joint_names: tuple[str, ...] = (), buttons: tuple[int, ...] = BUTTONS
) -> tuple[int, Values] | Refusal:
    """Stamp [ns] and values of any message of a kind, from its bytes; or the reason to refuse it.

    Args:
        kind: Kind of the values.
        data: Bytes from any sender.
        joint_names: As in :func:`read_values`.
        buttons: As in :func:`read_values`.
    """
    try:
        message = deserialise(data, kind.ros_type)
    except ValueError:
        return Refusal.MALFORMED
    return read_values(kind, message, joint_names, buttons)


def read_numbers(data: bytes, columns: tuple[str, ...]) -> tuple[int, Values] | Refusal:
    """Stamp [ns] and the named numbers, shape (columns,), of a report; or the reason to refuse it."""
    try:
        reports = read_reports(data)
    except ValueError:
        return Refusal.MALFORMED
    for found in reports:
        try:
            row = [float(found.values[name]) for name in columns]
        except (KeyError, ValueError):
            continue
        return found.stamp_ns, np.array(row, dtype=np.float64)
    return Refusal.WRONG_NAMES


def _row(kind: Kind, message: Any, joint_names: tuple[str, ...]) -> list[float] | Refusal:
    if kind is Kind.POSE:
        p, q = message.pose.position, message.pose.orientation
        return [p.x, p.y, p.z, q.w, q.x, q.y, q.z]
    if kind is Kind.POSES:
        found = [(p.position, p.orientation) for p in message.poses]
        row = [x for p, q in found for x in (p.x, p.y, p.z, q.w, q.x, q.y, q.z)]
        return row if len(row) == kind.width(0) else Refusal.WRONG_LENGTH
    if kind is Kind.TWIST:
        return _six(message.twist.linear, message.twist.angular)
    if kind is Kind.WRENCH:
        return _six(message.wrench.force, message.wrench.torque)
    return _joints(kind, message, joint_names)


def _pressed(message: Any, buttons: tuple[int, ...]) -> list[float] | Refusal:
    given = list(message.buttons)
    if max(buttons) >= len(given):
        return Refusal.FEW_BUTTONS
    return [given[index] if index >= 0 else 0.0 for index in buttons]


def _six(first: Any, second: Any) -> list[float]:
    return [first.x, first.y, first.z, second.x, second.y, second.z]


def _joints(kind: Kind, message: Any, joint_names: tuple[str, ...]) -> list[float] | Refusal:
    row: list[float] = []
    parts = ("position", "velocity", "effort") if kind.has_motion else ("position",)
    for part in parts:
        found = read_joints(message, part, joint_names)
        if found is Refusal.WRONG_LENGTH and part != "position" and not len(getattr(message, part)):
            found = np.full(len(joint_names) or len(message.name), math.nan)
        if isinstance(found, Refusal):
            return found
        row += found.tolist()
    return row


def read_joints(message: Any, part: str, joint_names: tuple[str, ...]) -> Values | Refusal:
    """Numbers (n,) of the joints in a JointState, in the order of their names.

    Args:
        message: Message of rclpy, or deserialised by rosbags. If it contains no names, its numbers must be in the
            order of ``joint_names``; clients of CRTK send such messages.
        part: ``position``, ``velocity`` or ``effort``.
        joint_names: Wanted order; other joints in the message are left out. If empty, all joints are returned in the
            order of the message.

    Returns:
        The numbers; or the reason why the message cannot be used.
    """
    names, numbers = list(message.name) or list(joint_names), getattr(message, part)
    if any(name not in names for name in joint_names):
        return Refusal.WRONG_NAMES
    if len(numbers) != len(names):
        return Refusal.WRONG_LENGTH
    order = [names.index(name) for name in joint_names] or range(len(names))
    return np.array([numbers[i] for i in order], dtype=np.float64)


def write_values(
    kind: Kind, message: Any, stamp_ns: int, values: Values, *, frame_id: str = "", joint_names: tuple[str, ...] = ()
) -> Any:
    """Fill a message with a stamp [ns] and values, shape (width,); returns the message."""
    header, row = message.header, values.tolist()
    header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, SECOND_NS)
    header.frame_id = frame_id
    if kind is Kind.POSE:
        _set(message.pose.position, "xyz", row[:3])
        _set(message.pose.orientation, "wxyz", row[3:])
    elif kind is Kind.POSES:
        for i, pose in enumerate(message.poses):  # of which the message has enough
            _set(pose.position, "xyz", row[7 * i : 7 * i + 3])
            _set(pose.orientation, "wxyz", row[7 * i + 3 : 7 * i + 7])
    elif kind is Kind.TWIST:
        _set(message.twist.linear, "xyz", row[:3])
        _set(message.twist.angular, "xyz", row[3:])
    elif kind is Kind.WRENCH:
        _set(message.wrench.force, "xyz", row[:3])
        _set(message.wrench.torque, "xyz", row[3:])
    elif kind is Kind.BUTTONS:
        message.buttons = [int(number) for number in row]
    else:
        count = len(joint_names)
        message.name, message.position = list(joint_names), row[:count]
        message.velocity, message.effort = row[count : 2 * count], row[2 * count :]
    return message


def _set(target: Any, names: str, numbers: list[float]) -> None:
    for name, number in zip(names, numbers, strict=True):
        setattr(target, name, number)
