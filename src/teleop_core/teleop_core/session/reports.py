"""Reports of a session's stages: as messages with numbers, and as text."""

from collections.abc import Mapping

from teleop_core.bags.reports import report
from teleop_core.graph import STATE_FIELDS, topics
from teleop_core.kernels.geometry import Array
from teleop_core.slave.operation import operation_level, operation_text


def report_of(topic: topics.Topic, stamp_ns: int, row: Array, described: Mapping[str, str] | None = None) -> bytes:
    """Message of a report's topic, as CDR bytes.

    Args:
        topic: Topic of the report, such as :data:`~teleop_core.graph.topics.TELEOP_STATE`.
        stamp_ns: Stamp [ns].
        row: Numbers of the report (columns,).
        described: Further names and texts, such as a description of the fixture.
    """
    values = {name: repr(float(value)) for name, value in zip(topic.columns, row, strict=True)}
    more, name, level, text = dict(described or {}), topic.name, 0, ""
    if topic.columns == STATE_FIELDS:
        name, text = "teleop", state_text(row, more.get("fixture", "box"))
    elif topic.columns == topics.OPERATION:
        numbers = dict(zip(topics.OPERATION, row.tolist(), strict=True))
        names = tuple(more.pop("joints", "").split())
        level, text = operation_level(numbers), operation_text(numbers, names)
    return report(stamp_ns, name, level, text, values | more)


def state_text(state: Array, fixture: str = "box") -> str:
    """State as text: CLUTCHED, FOLLOWING or ALIGNING, then mode, fixture and limit."""
    named = dict(zip(STATE_FIELDS, state, strict=True))
    doing = "CLUTCHED" if named["is_clutched"] else "FOLLOWING"
    if not named["is_following"]:
        doing = "ALIGNING"
    mode = "fine" if named["is_fine"] else "coarse"
    text = f"{doing} {mode}{f', {fixture} on' if named['is_fixture_on'] else ''}"
    limit, joint = int(named["limit"]), int(named["limited_joint"])
    return f"{text}, held back: {topics.limit_text(limit, joint)}" if limit else text
