"""Units of a recording's columns, for tables that leave the package."""

from teleop_core.topics import BY_NAME

_BY_COLUMN = {
    **dict.fromkeys("xyz", "m"),
    **dict.fromkeys(("qw", "qx", "qy", "qz"), "1"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys(("wx", "wy", "wz"), "rad/s"),
    **dict.fromkeys(("fx", "fy", "fz"), "N"),
    **dict.fromkeys(("tx", "ty", "tz"), "Nm"),
}


def unit_of(topic: str, column: str) -> str:
    """Unit of a column of a topic; empty where it has none.

    Joints may turn or slide: their positions are in rad or m.
    """
    known = next((t for n, t in BY_NAME.items() if topic == n or topic.endswith(f"/{n}")), None)
    if known is not None and known.columns:
        return _of_number(column)
    if known is None or not known.kind.has_joints:
        return _BY_COLUMN.get(column, "")
    last = column.rpartition(".")[2]
    return {"velocity": "rad/s or m/s", "effort": "Nm or N"}.get(last, "rad or m")


def _of_number(column: str) -> str:
    """Unit of a named number, as of a report."""
    if column.startswith(("fixture_center", "fixture_size")):
        return "m"
    if column == "position_residual" or column in {"cut_x", "cut_y", "cut_z"}:
        return "m"
    return "rad" if column == "rotation_residual" or column.startswith("cut_r") else ""
