"""Import options: the columns or topics of a file that contain the hand's motion, with units and axes."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from teleop_core.base.errors import ParameterError, UnknownNameError

if TYPE_CHECKING:
    from teleop_core.kernels.geometry import Array

Columns = tuple[str, ...]
"""Names of columns, or their numbers, counted from 1; ``4-12`` means nine columns."""
Option = str | int | float | bool | None | tuple[str | int, ...] | list[str] | list[int]
"""Value of one option; a column may be given as an integer."""
Changes = Mapping[str, Option]
"""Import options by name."""

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
"""Units of length [m]."""
TIMES_NS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1000, "ns": 1}
"""Units of time [ns]."""
DAY_NS = 86_400 * TIMES_NS["s"]
CLOCKS = {
    "dotnet": (100, 621_355_968_000_000_000),
    "filetime": (100, 116_444_736_000_000_000),
    "excel": (DAY_NS, 25_569),
    "matlab": (DAY_NS, 719_529),
}
"""Clocks of other epochs: unit [ns], and the value at the beginning of 1970. ``dotnet`` and ``filetime`` count 100 ns
since the years 1 and 1601, ``excel`` and ``matlab`` count days since 1900 and the year 0."""
BUTTONS = ("clutch", "fixture", "mode")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
ORIENTATIONS = ("quaternion", "matrix", "euler", "rotation_vector")
"""Options that name the columns of the orientation."""
CHOICES = {
    "time_unit": ("auto", *TIMES_NS, *CLOCKS),
    "stamps": ("header", "log"),
    "unit": ("auto", *LENGTHS),
    "quaternion_order": ("auto", "wxyz", "xyzw"),
    "matrix_order": ("row", "column"),
    "angles": ("auto", "rad", "deg"),
    "orientation": ("auto", "none"),
    "center": ("keep", "mean", "middle", "start"),
    "backwards": ("auto", "refuse", "drop", "sort"),
    "handedness": ("right", "left"),
}
_COUNTS = {
    "time": (0, 1, 2),
    "position": (0, 3),
    "quaternion": (0, 4),
    "matrix": (0, 9),
    "euler": (0, 4),
    "rotation_vector": (0, 3),
    "jaw": (0, 3),
}
_IS_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?")
_TUPLES = (*_COUNTS, "axes", "numbered_by")


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Options of an import: what is read from a file, and how it is converted.

    Columns are given by name, or by number counted from 1; ``"4-12"`` stands for nine columns. Options that are not
    given are guessed from the names, and the report lists the guesses.

    Attributes:
        time: Column of the time, or two columns with whole seconds and nanoseconds.
        rate: Samples per second [Hz], for tables without a time.
        time_unit: ``auto``, ``s``, ``ms``, ``us`` or ``ns``, or a clock: ``dotnet``, ``filetime``, ``excel`` or
            ``matlab``.
        stamps: Source of the times of a bag's messages: ``header`` for their stamps, ``log`` for their times of
            recording.
        position: Three columns.
        unit: Unit of the position: ``m``, ``cm``, ``mm``, ``in``, or ``auto`` (from the names, else m).
        quaternion: Four columns in the order of ``quaternion_order``.
        quaternion_order: ``wxyz``, ``xyzw``, or ``auto`` (from the names, else wxyz).
        matrix: Nine columns of a rotation matrix.
        matrix_order: Order of the matrix's columns in the file: ``row`` (row by row) or ``column`` (column by column).
        euler: Order of the axes and three columns: ``("xyz", "roll", "pitch", "yaw")``. Small letters are rotations
            about fixed axes, capital letters about the body's axes (as in SciPy).
        rotation_vector: Three columns.
        angles: Unit of Euler angles and rotation vectors: ``auto``, ``rad`` or ``deg``.
        orientation: ``auto`` guesses the columns if none are given; ``none`` uses a constant orientation.
        clutch: Column of the clutch button, which is pressed above ``threshold``; empty for no button.
        fixture: Column of the fixture button, with the same rules as ``clutch``.
        mode: Column of the mode button, with the same rules as ``clutch``.
        jaw: Column of the jaw or gripper, with its values when it is open and when it is closed:
            ``("width", "0.08", "0")``. The hand then closes the slave's jaw in the same share.
        threshold: Value above which a button counts as pressed.
        skip: Number of lines to leave out at the beginning of a text file.
        episode: Number of the recording in a table of several recordings; None for a table of one recording. ``all``
            imports each into a directory of recordings, also for the directory of a LeRobot data set.
        numbered_by: Columns that number the recordings of a table; the combinations of several columns are numbered
            from 0. Empty for the column called ``episode_index`` or the like, ``none`` for a single recording.
        topic: Topic of the poses in a bag, or the end of its name; empty if only one topic contains poses.
        frame: Child frame of the poses; needed if the topic contains several child frames.
        parent: Parent frame of the poses; needed if the topic contains several parent frames.
        buttons_topic: Topic of the Joy messages, or the end of its name; empty if at most one topic contains them. If
            several names are given, separated by ``|``, the first existing topic is used; an empty last name allows a
            bag without buttons.
        buttons: Indices of the buttons in a Joy message, such as ``"clutch=0,mode=2"``; ``none`` for no buttons.
        axes: The master's x, y and z as axes of the file: ``("+y", "-x", "+z")``.
        handedness: Handedness of the file's axes: ``right``, or ``left`` as in game engines. With ``left``, ``axes``
            must mirror, and orientations are also mirrored.
        scale: Factor for all positions.
        center: Point that is moved to zero: ``mean`` of the positions, ``middle`` of their range, or their ``start``.
            With ``keep``, positions are not moved.
        backwards: Treatment of rows whose time goes back: ``refuse``, ``drop`` or ``sort``. ``auto`` drops up to 1 % of
            the rows, and refuses more.
        gap: Gaps longer than this number of periods are reported.
    """

    time: Columns = ()
    rate: float | None = None
    time_unit: str = "auto"
    stamps: str = "header"
    position: Columns = ()
    unit: str = "auto"
    quaternion: Columns = ()
    quaternion_order: str = "auto"
    matrix: Columns = ()
    matrix_order: str = "row"
    euler: Columns = ()
    rotation_vector: Columns = ()
    angles: str = "auto"
    orientation: str = "auto"
    clutch: str = ""
    fixture: str = ""
    mode: str = ""
    jaw: Columns = ()
    threshold: float = 0.5
    skip: int = 0
    episode: int | Literal["all"] | None = None
    numbered_by: Columns = ()
    topic: str = ""
    frame: str = ""
    parent: str = ""
    buttons_topic: str = ""
    buttons: str = ""
    axes: Annotated[tuple[str, str, str], Parameter(allow_leading_hyphen=True)] = ("+x", "+y", "+z")
    handedness: str = "right"
    scale: float = 1.0
    center: str = "keep"
    backwards: str = "auto"
    gap: float = 5.0

    def __post_init__(self) -> None:
        for name in _TUPLES:
            object.__setattr__(self, name, expanded(getattr(self, name)))
        for name in BUTTONS:
            object.__setattr__(self, name, str(getattr(self, name)))
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise UnknownNameError(option(name), getattr(self, name), choices)
        self._check_columns()
        self._check_numbers()
        button_map(self.buttons)
        self._check_axes()

    def _check_axes(self) -> None:
        if len(self.axes) != 3 or not set(self.signed_axes) <= set(AXES):
            raise ParameterError("--axes", self.axes, "three of " + ", ".join(AXES))
        self.axis_map()

    def axis_map(self) -> "Array":
        """Matrix (3, 3) from the file's axes to the master's axes; it mirrors left-handed axes.

        Raises:
            ParameterError: An axis is used twice, or the map mirrors although ``handedness`` is ``right``, or the map
                does not mirror although it is ``left``.
        """
        import numpy as np  # this also imports compiled kernels, which `--help` does not need

        from teleop_core.kernels.axes import axis_map

        x, *others = self.signed_axes
        if self.handedness == "right":
            return axis_map("--axes", (x, *others))
        mirror = np.array([[-1.0], [1.0], [1.0]])  # mirrors the first row
        try:
            return np.asarray(mirror * axis_map("--axes", (x.translate(str.maketrans("+-", "-+")), *others)))
        except ParameterError:
            needed = "three axes at right angles that mirror, for --handedness left"
            raise ParameterError("--axes", self.axes, needed) from None

    def _check_columns(self) -> None:
        for name, counts in _COUNTS.items():
            given = getattr(self, name)
            if len(given) not in counts:
                needed = " or ".join(str(count) for count in counts if count)
                forms = {"euler": "an order and three columns", "jaw": "a column, its value if open, and if closed"}
                what = forms.get(name, f"{needed} columns")
                raise ParameterError(option(name), given, what)
        if several := [option(name) for name in ORIENTATIONS if getattr(self, name)][1:]:
            raise ParameterError(several[0], "given", "the only option that defines the orientation")
        order = self.euler[0] if self.euler else "xyz"
        if not is_euler_order(order):
            needed = "three of xyz or of XYZ, no axis twice in a row, such as xyz or ZYX"
            raise ParameterError(option("euler"), order, needed)

    def _check_numbers(self) -> None:
        if self.time and self.rate is not None:
            raise ParameterError("--rate", self.rate, "left out: --time is given")
        for name in ("rate", "scale", "gap"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise ParameterError(option(name), value, "finite and above 0")
        if self.episode not in {None, "all"} and not isinstance(self.episode, int):
            raise ParameterError("--episode", self.episode, "a number, or all")
        if self.jaw and not abs(self.jaw_ends[0] - self.jaw_ends[1]) > 0.0:  # NaN too
            raise ParameterError("--jaw", self.jaw, "a column and two different numbers")
        if self.skip < 0:
            raise ParameterError("--skip", self.skip, "0 or more")

    @property
    def jaw_ends(self) -> tuple[float, float]:
        """Values of the jaw's column when it is open and when it is closed; NaN for words that are no numbers."""
        opened, closed = (float(word) if _IS_NUMBER.fullmatch(word) else math.nan for word in self.jaw[1:])
        return opened, closed

    @property
    def signed_axes(self) -> Columns:
        """Axes with their signs."""
        return tuple(axis.lower() if axis[:1] in {"+", "-"} else f"+{axis}" for axis in self.axes)

    def changed(self, **changes: Option) -> "ImportOptions":
        """Copy of the options with some values changed.

        Raises:
            UnknownNameError: An option does not exist, or the value of an option is not in its list of names.
            ParameterError: A value is not allowed.
        """
        known = [field.name for field in fields(self)]
        if unknown := [name for name in changes if name not in known]:
            raise UnknownNameError("import option", unknown[0], known)
        return replace(self, **changes)  # type: ignore[arg-type]

    def as_arguments(self) -> list[str]:
        """The options that differ from their defaults, as arguments of ``teleop import``."""
        words: list[str] = []
        for field in fields(self):
            value = getattr(self, field.name)
            if value != field.default:
                words.append(option(field.name))
                words += [str(one) for one in value] if isinstance(value, tuple) else [str(value)]
        return words


def options_of(base: ImportOptions, arms: Mapping[str, Changes], changes: Changes) -> dict[str, ImportOptions]:
    """Options of each arm, the default arm first; ``{"": ...}`` if the only arm has no name.

    Args:
        base: Common options of all hands.
        arms: Additional options of each hand.
        changes: Changes for all hands.

    Raises:
        UnknownNameError: An option does not exist.
        ParameterError: The name of an arm is not allowed in a topic.
    """
    for name in arms:
        if not name.isidentifier() or not name.isascii():
            raise ParameterError("--arm", name, "a name of letters, digits and _")
    own = arms or {"": {}}
    return {name: base.changed(**{**changes, **one}) for name, one in own.items()}


def button_map(text: str) -> dict[str, int]:
    """Indices of a Joy's buttons by their function, from ``clutch=0,mode=2``; empty for ``none``.

    Raises:
        ParameterError: The text has another form.
    """
    found: dict[str, int] = {}
    for entry in filter(None, text.replace(" ", "").split(",")) if text != "none" else ():
        name, equals, number = entry.partition("=")
        if name not in BUTTONS or not equals or not number.isdigit():
            needed = f"as clutch=0,mode=2, with names of {', '.join(BUTTONS)}; or none"
            raise ParameterError("--buttons", text, needed)
        found[name] = int(number)
    return found


def option(name: str) -> str:
    """Name of an option on the command line."""
    return "--" + name.replace("_", "-")


def expanded(value: object) -> Columns:
    """Columns as a tuple of texts, with ``4-12`` written out."""
    given = value if isinstance(value, tuple | list) else (value,)
    out: list[str] = []
    for one in map(str, given):
        first, dash, last = one.partition("-")
        if dash and first.isdigit() and last.isdigit() and 0 <= int(last) - int(first) < 64:
            out += map(str, range(int(first), int(last) + 1))
        else:
            out.append(one)
    return tuple(out)


def is_euler_order(order: str) -> bool:
    """Whether a text is an order of Euler angles as in SciPy."""
    small = order.lower()
    is_one_case = order in {small, order.upper()}
    repeats = any(a == b for a, b in pairwise(small))
    return len(order) == 3 and set(small) <= set("xyz") and is_one_case and not repeats
