"""Reports: rare messages of names and texts, as ``diagnostic_msgs/DiagnosticArray``."""

from collections.abc import Mapping
from typing import NamedTuple

from teleop_core.bags import layouts, ros_types
from teleop_core.base.texts import printable
from teleop_core.graph.topics import Kind


class Report(NamedTuple):
    """One status of a report message."""

    stamp_ns: int
    name: str
    level: int  # 0 ok, 1 warning, 2 error, 3 stale
    message: str
    values: dict[str, str]


def report(stamp_ns: int, name: str, level: int, message: str, values: Mapping[str, str], hardware: str = "") -> bytes:
    """CDR bytes of a report with one status.

    Args:
        stamp_ns: Time of the report, [ns].
        name: Name of the reporting component.
        level: 0 ok, 1 warning, 2 error, 3 stale.
        message: One line of text for users.
        values: Names and texts of the reported values.
        hardware: Identifier of the reported hardware.
    """
    types = ros_types.typestore().types
    pairs = [types["diagnostic_msgs/msg/KeyValue"](key, text) for key, text in values.items()]
    status = types["diagnostic_msgs/msg/DiagnosticStatus"](level, name, message, hardware, pairs)
    time = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, layouts.SECOND_NS))
    header = types["std_msgs/msg/Header"](time, "")
    return ros_types.serialise(types[Kind.REPORT.ros_type](header, [status]))


def read_reports(data: bytes) -> list[Report]:
    """All statuses of one report message, their texts made printable.

    Raises:
        ValueError: The bytes are no report.
    """
    array = ros_types.deserialise(data, Kind.REPORT.ros_type)
    stamp = array.header.stamp
    stamp_ns = stamp.sec * layouts.SECOND_NS + stamp.nanosec
    return [
        Report(
            stamp_ns,
            printable(s.name),
            s.level,
            printable(s.message),
            {printable(pair.key): printable(pair.value) for pair in s.values},
        )
        for s in array.status
    ]
