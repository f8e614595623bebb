"""Names of columns: finds the columns of time, position, orientation and buttons by their names."""

import re
from collections.abc import Sequence

from teleop_exchange.options import LENGTHS, TIMES_NS

_UNITS = {
    **{name: name for name in (*LENGTHS, *TIMES_NS)},
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millis": "ms",
    "milliseconds": "ms", "usec": "us", "µs": "us", "micros": "us", "microseconds": "us",
    "nsec": "ns", "nsecs": "ns", "nanos": "ns", "nanosec": "ns", "nanoseconds": "ns",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "millimeters": "mm", "inch": "in",
    "inches": "in", "centimeters": "cm", "rad": "rad", "radians": "rad", "deg": "deg",
    "degree": "deg", "degrees": "deg", "°": "deg",
}  # fmt: skip
_TIMES = ("time", "t", "timestamp", "stamp", "times", "timestamps", "clock", "seconds", "secs",
          "elapsed", "ros_time", "rostime", "datetime")  # fmt: skip
_NOT_PLACES = re.compile(
    r"(^|_)(q|quat\w*|orient\w*|rot\w*|r|euler|angles?|ang\w*|omega|w|vel\w*|v|acc\w*|a|lin\w*"
    r"|twist|force|f|torque|wrench|t|gyro|mag\w*|cov\w*|fixed|dir\w*|forward|axis|scale|gravity)"
    r"(_|$)"
)
_PLACES = re.compile(r"(^|_)(pos\w*|trans\w*|place|p|loc\w*|xyz|point|tip|hand|t)(_|$)")
_TURNS = re.compile(r"(^|_)(q|quat\w*|orient\w*|rot\w*|attitude|r|o)(_|$)")
_EPISODES = re.compile(r"(episode|trial|demo)(_(index|id|number|nr))?")
_VECTORS = re.compile(r"(^|_)(rotvec|rot_vec\w*|rotation_vec\w*|rvec|axis_angle|r)(_|$)")


def plain(name: str) -> str:
    """Name in small letters, without its unit, with ``_`` for all word separators."""
    text, _ = without_unit(name)
    text = re.sub(r"([a-z])([XYZW])(?![a-z])", r"\1_\2", text.strip())
    return re.sub(r"[^0-9a-z]+", "_", text.lower()).strip("_")


def without_unit(name: str) -> tuple[str, str]:
    """Name and unit of a column such as ``x [mm]``, ``x (mm)`` or ``x_mm``; the unit may be empty."""
    found = re.search(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$", name)
    if found and (unit := _UNITS.get(found[1].lower())):
        return name[: found.start()], unit
    found = re.search(r"_(mm|cm|ms|us|ns|sec|secs|nsec|nsecs|deg|rad|s|m|in)$", name.strip(), re.I)
    if found:
        return name[: found.start()], _UNITS[found[1].lower()]
    return name, ""


def find_time(names: Sequence[str]) -> tuple[int, ...]:
    """Column of the time, or the two columns of seconds and nanoseconds; empty if no name indicates a time."""
    ends = [plain(name).rpartition("_")[2] for name in names]
    for seconds, rest in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
        raw = [re.sub(r"[^0-9a-z]+", "_", name.lower()).rpartition("_")[2] for name in names]
        if seconds in raw and rest in raw:
            return raw.index(seconds), raw.index(rest)
    whole = [plain(name) for name in names]
    for wanted in _TIMES:
        if wanted in whole:
            return (whole.index(wanted),)
    for wanted in _TIMES:
        if wanted != "t" and wanted in ends:
            return (ends.index(wanted),)
    return ()


def find_positions(names: Sequence[str]) -> list[tuple[int, ...]]:
    """Columns of x, y and z of all positions that the names suggest equally well, in the order of the file."""
    found = _series(names, "xyz", without="w") or _series(names, "xyz")
    good = [(stem, columns) for stem, columns in found.items() if not _NOT_PLACES.search(stem)]
    named = [columns for stem, columns in found.items() if _PLACES.search(stem)]
    bare = [columns for stem, columns in good if not stem.strip("_")]
    return bare or named or [columns for _, columns in good] or _after_a_name(names)


def _after_a_name(names: Sequence[str]) -> list[tuple[int, ...]]:
    """Find adjacent columns such as ``Tool X``, ``Y``, ``Z``; only the first name contains the object's name."""
    plain_names = [plain(name) for name in names]
    return [
        (i, i + 1, i + 2)
        for i, name in enumerate(plain_names[:-2])
        if name.endswith("_x") and plain_names[i + 1 : i + 3] == ["y", "z"]
    ]


def find_quaternion(names: Sequence[str]) -> tuple[int, ...]:
    """Columns of w, x, y, z of a quaternion, in this order; empty if no names indicate one."""
    found = _series(names, "wxyz")
    named = [columns for stem, columns in found.items() if _TURNS.search(stem)]
    return next(iter((*named, *found.values())), ()) or _numbered(names)


def _numbered(names: Sequence[str]) -> tuple[int, ...]:
    """Find columns q0, q1, q2, q3; by convention the first is w."""
    whole = [plain(name) for name in names]
    for start in ("q", "q_", "quat_", "quaternion_", "quat", "orientation_"):
        if all(f"{start}{i}" in whole for i in range(4)):
            return tuple(whole.index(f"{start}{i}") for i in range(4))
    return ()


def find_matrix(names: Sequence[str]) -> tuple[int, ...]:
    """Columns of a rotation matrix row by row; empty if no names indicate one."""
    whole = [plain(name) for name in names]
    for start in ("r", "r_", "rot", "rot_", "m", "m_", "rotation_", "matrix_", "rotation_matrix_"):
        for first in (0, 1):
            cells = [[f"{start}{i}{gap}{j}" for i in _three(first) for j in _three(first)] for gap in ("", "_")]
            for wanted in cells:
                if all(name in whole for name in wanted):
                    return tuple(whole.index(name) for name in wanted)
    return ()


def _three(first: int) -> range:
    return range(first, first + 3)


def find_rotation_vector(names: Sequence[str]) -> tuple[int, ...]:
    """Columns of a rotation vector; empty if no names indicate one."""
    found = _series(names, "xyz", without="w")
    return next((columns for stem, columns in found.items() if _VECTORS.search(stem)), ())


def find_euler(names: Sequence[str]) -> tuple[int, ...]:
    """Columns of roll, pitch and yaw; empty if no names indicate them."""
    whole = [plain(name) for name in names]
    out = []
    for wanted in ("roll", "pitch", "yaw"):
        hits = [i for i, name in enumerate(whole) if name == wanted or name.endswith(f"_{wanted}")]
        if not hits:
            return ()
        out.append(hits[0])
    return tuple(out)


def find_button(names: Sequence[str], button: str) -> int | None:
    """Column of a button by its name."""
    whole = [plain(name) for name in names]
    return next((i for i, name in enumerate(whole) if name.rpartition("_")[2] == button), None)


def find_episode(names: Sequence[str]) -> int | None:
    """Column with the number of the recording to which each row belongs, as in data sets of LeRobot."""
    whole = [plain(name) for name in names]
    return next((i for i, name in enumerate(whole) if _EPISODES.fullmatch(name)), None)


def unit_of(names: Sequence[str], columns: Sequence[int]) -> str:
    """Unit in the names of the given columns; empty if a name has no unit or the units differ."""
    units = {without_unit(names[column])[1] for column in columns}
    return units.pop() if len(units) == 1 else ""


def _series(names: Sequence[str], letters: str, without: str = "") -> dict[str, tuple[int, ...]]:
    """Columns whose names differ only in one letter, by the name without that letter.

    Series that also have a column with the letter ``without`` are left out.

    ``pose_position_x`` has the stem ``pose_position_``; ``qx`` has ``q_``, which distinguishes it from a bare ``x``.
    """
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        text = plain(name)
        for match in re.finditer(r"(?:(?<=_)|^|(?<=^[a-z])|(?<=_[a-z]))([wxyz])(?=_|$)", text):
            begin = text[: match.start()]
            gap = "_" if begin and not begin.endswith("_") else ""
            stem = f"{begin}{gap}{text[match.end() :]}"
            found.setdefault(stem, {}).setdefault(match[1], column)
    return {
        stem: tuple(hits[letter] for letter in letters)
        for stem, hits in found.items()
        if set(letters) <= set(hits) and not set(without) & set(hits)
    }
