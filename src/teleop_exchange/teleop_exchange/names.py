"""Names of columns: finds the columns of time, position, orientation and buttons by their names."""

import re
from collections.abc import Collection, Sequence
from typing import NamedTuple

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
_TIMES = ("time", "t", "timestamp", "stamp", "times", "timestamps", "clock", "seconds", "secs", "elapsed",
          "ros_time", "rostime", "datetime", "date_time", "ticks", "filetime", "datenum", "date")  # fmt: skip
_COUNTERS = re.compile(
    r"(^|_)(frames?|ind(ex|ices)|idx|i|n|no|nr|num|number|count(er)?|samples?|seq(uence)?|id|ids|rows?|steps?|images?|img|picture)(_|$)"
)
_NOT_PLACES = re.compile(
    r"(^|_)(q|quat\w*|orient\w*|rot\w*|r|euler|angles?|ang\w*|omega|w|vel\w*|v|acc\w*|a|lin\w*"
    r"|twist|force|f|torque|wrench|t|gyro|mag\w*|cov\w*|fixed|dir\w*|forward|axis|scale|gravity)"
    r"(_|$)"
)
_PLACES = re.compile(r"(^|_)(pos\w*|trans\w*|place|p|loc\w*|xyz|point|t)(_|$)")
_HANDS = re.compile(r"(^|_)(tip|hand)(_|$)")
_SIDES = {"r": ("l", "right"), "a": ("b", "first")}
"""Letters that name a body if another body has the counterpart, with a word for them; alone they mean a rotation, an
acceleration."""
_TURNS = re.compile(r"(^|_)(q|quat\w*|orient\w*|rot\w*|attitude|r|o)(_|$)")
_ANGLES = re.compile(r"(^|_)(r|rot\w*|orient\w*|attitude|euler|angles?|rpy|theta)(_|$)")
_NO_ANGLES = re.compile(r"vel|acc|rate|speed|omega|torque|force|cov|noise|std|error")
_OF_ANY_BODY = re.compile(
    r"pos\w*|trans\w*|place|loc\w*|xyz|point|pose|q|quat\w*|orient\w*|rot\w*|attitude|euler|angles?|rpy|rvec|vec\w*|axis"
)
_BEFORE_AXIS = {"t", "p", "q", "r", "o"}
_EPISODES = re.compile(r"(episode|trial|demo)(_(index|id|number|nr))?")
_NUMBERINGS = re.compile(
    r"(^|_)(episode|trial|demo\w*|stage|session|run|take|block|subject|participant|person|user|recording|part|phase|set"
    r"|round|repetition|rep|attempt|try|condition|group|lap|game|match|task)(_(index|id|number|nr))?$"
)
_VECTORS = re.compile(r"(^|_)(rotvec|rot_vec\w*|rotation_vec\w*|rvec|axis_angle)(_|$)")


class Group(NamedTuple):
    """Columns of one quantity.

    Attributes:
        stem: What the plain names of the columns have in common.
        columns: The columns, in the order of the quantity's numbers.
        body: Words of the names that tell whose quantity it is; empty if no word tells it.
    """

    stem: str
    columns: tuple[int, ...]
    body: tuple[str, ...] = ()


def plain(name: str) -> str:
    """Name in small letters, without its unit, with ``_`` for all word separators."""
    text, _ = without_unit(name)
    text = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", text.strip())
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


def is_counter(name: str) -> bool:
    """Whether a name says that a column numbers the rows."""
    return name.startswith(("column ", "Unnamed")) or bool(_COUNTERS.search(plain(name)))


def triples(names: Sequence[str]) -> list[Group]:
    """All columns whose names differ only in x, y and z, in the order of the file."""
    return _series(names, "xyz")


def positions(names: Sequence[str], groups: Sequence[Group]) -> list[Group]:
    """Those of the groups x, y, z that the names suggest equally well as a position, in the order of the file."""
    good = [group for group in groups if not _NOT_PLACES.search(group.stem)]
    bare = [group for group in good if not group.stem.strip("_0123456789")]
    hands = [group for group in good if _PLACES.search(group.stem) or _HANDS.search(group.stem)]
    named = [group for group in groups if _PLACES.search(group.stem)]
    return bare or hands or named or good or _after_a_name(names)


def _after_a_name(names: Sequence[str]) -> list[Group]:
    """Find adjacent columns such as ``Tool X``, ``Y``, ``Z``; only the first name contains the object's name."""
    plain_names = [plain(name) for name in names]
    return [
        Group(name, (i, i + 1, i + 2))
        for i, name in enumerate(plain_names[:-2])
        if name.endswith("_x") and plain_names[i + 1 : i + 3] == ["y", "z"]
    ]


def quaternions(names: Sequence[str]) -> list[Group]:
    """Columns of w, x, y, z of each quaternion that the names indicate."""
    found = _series(names, "wxyz")
    named = [group for group in found if is_turn(group)]
    return named or found or _numbered(names)


def is_turn(group: Group) -> bool:
    """Whether the names say that a group is an orientation."""
    return bool(_TURNS.search(group.stem))


def _numbered(names: Sequence[str]) -> list[Group]:
    """Find columns q0, q1, q2, q3; by convention the first is w."""
    whole = [plain(name) for name in names]
    for start in ("q", "q_", "quat_", "quaternion_", "quat", "orientation_"):
        if all(f"{start}{i}" in whole for i in range(4)):
            return [Group(start, tuple(whole.index(f"{start}{i}") for i in range(4)))]
    return []


def matrices(names: Sequence[str]) -> list[Group]:
    """Columns of a rotation matrix row by row; empty if no names indicate one."""
    whole = [plain(name) for name in names]
    for start in ("r", "r_", "rot", "rot_", "m", "m_", "rotation_", "matrix_", "rotation_matrix_"):
        for first in (0, 1):
            cells = [[f"{start}{i}{gap}{j}" for i in _three(first) for j in _three(first)] for gap in ("", "_")]
            for wanted in cells:
                if all(name in whole for name in wanted):
                    return [Group(start, tuple(whole.index(name) for name in wanted))]
    return []


def _three(first: int) -> range:
    return range(first, first + 3)


def rotation_vectors(groups: Sequence[Group]) -> list[Group]:
    """Those of the groups x, y, z whose names say that they are rotation vectors."""
    return [group for group in groups if _VECTORS.search(group.stem)]


def angles(groups: Sequence[Group]) -> list[Group]:
    """Those of the groups x, y, z that are angles by their names, which do not say of which kind."""
    found = [group for group in groups if _ANGLES.search(group.stem) and not _NO_ANGLES.search(group.stem)]
    return [group for group in found if not _VECTORS.search(group.stem)]


def eulers(names: Sequence[str]) -> list[Group]:
    """Columns of roll, pitch and yaw that differ only in these words."""
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        if match := re.fullmatch(r"(.*?)(?:^|_)(roll|pitch|yaw)(_.*)?", plain(name)):
            found.setdefault(f"{match[1]}_{match[3] or ''}", {}).setdefault(match[2], column)
    wanted = ("roll", "pitch", "yaw")
    return [
        Group(stem, tuple(hits[word] for word in wanted), _body(*stem.split("_", 1)))
        for stem, hits in found.items()
        if len(hits) == len(wanted)
    ]


def find_button(names: Sequence[str], button: str) -> int | None:
    """Column of a button by its name."""
    whole = [plain(name) for name in names]
    return next((i for i, name in enumerate(whole) if name.rpartition("_")[2] == button), None)


def find_episode(names: Sequence[str]) -> int | None:
    """Column with the number of the recording to which each row belongs, as in data sets of LeRobot."""
    whole = [plain(name) for name in names]
    return next((i for i, name in enumerate(whole) if _EPISODES.fullmatch(name)), None)


def find_numberings(names: Sequence[str]) -> list[int]:
    """Columns that may number recordings, alone or together with others."""
    return [i for i, name in enumerate(names) if _NUMBERINGS.search(plain(name))]


def unit_of(names: Sequence[str], columns: Sequence[int]) -> str:
    """Unit in the names of the given columns; empty if a name has no unit or the units differ."""
    units = {without_unit(names[column])[1] for column in columns}
    return units.pop() if len(units) == 1 else ""


def _series(names: Sequence[str], letters: str) -> list[Group]:
    """Columns whose names differ only in one letter; the stem is the name without that letter.

    ``pose_position_x`` has the stem ``pose_position_``; ``qx`` has ``q_``, which distinguishes it from a bare ``x``.
    """
    found: dict[tuple[str, str], dict[str, int]] = {}
    for column, name in enumerate(names):
        text = plain(name)
        for match in re.finditer(r"(?:(?<=_)|^|(?<=^[a-z])|(?<=_[a-z]))([wxyz])(?=_|$)", text):
            begin = text[: match.start()]
            gap = "_" if begin and not begin.endswith("_") else ""
            found.setdefault((begin + gap, text[match.end() :]), {}).setdefault(match[1], column)
    whole = {
        stem: tuple(hits[letter] for letter in letters) for stem, hits in found.items() if set(letters) <= set(hits)
    }
    groups = []
    for (begin, end), columns in whole.items():
        sided = _sided(begin, end, whole)
        groups.append(Group(sided + end, columns, _body(begin, end, is_sided=sided != begin)))
    return groups


def _sided(begin: str, end: str, stems: Collection[tuple[str, str]]) -> str:
    """Begin of a name with a word for a letter that names a body, because another body has its counterpart."""
    for letter, (counterpart, word) in _SIDES.items():
        other = re.sub(rf"(^|_){letter}_", rf"\1{counterpart}_", begin)
        if other != begin and (other, end) in stems:
            return re.sub(rf"(^|_){letter}_", rf"\1{word}_", begin)
    return begin


def _body(before: str, after: str, *, is_sided: bool = False) -> tuple[str, ...]:
    """Words before and after the axis in a name, without those that only say what the quantity is.

    Args:
        before: Text before the axis.
        after: Text after the axis.
        is_sided: Whether a single letter before the axis names the body.
    """
    words = before.strip("_").split("_")
    if words[-1] in _BEFORE_AXIS and not is_sided:
        words.pop()
    words += after.strip("_").split("_")
    return tuple(word for word in words if word and not _OF_ANY_BODY.fullmatch(word))
