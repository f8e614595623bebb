"""Robots: one interface for every arm, whether built in, described by a table or your own.

``load_robot("rcrt1")`` takes a name of :func:`list_robots` or the path of a Denavit-Hartenberg table.
``robot_from_table({...})`` makes a robot from such a table. :func:`register_robot` gives a robot a name for
``--set robot=``. So does the entry-point group ``teleop_core.robots`` of an installed package. Example::

    from teleop_core.robots import register_robot, robot_from_table

    arm = robot_from_table({
        "name": "my_arm", "convention": "modified", "angles": "degrees",
        "rows": [
            {"theta": "q", "lower": -150, "upper": 150},
            {"a": 0.4, "theta": "q", "lower": -120, "upper": 120, "home": 60},
            {"a": 0.3, "d": "q", "lower": -0.1, "upper": 0.1},
        ],
        "task": ["x", "y", "z"],
    })
    register_robot(arm)
"""

import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from teleop_core.base.errors import ParameterError, TeleopWarning
from teleop_core.kinematics import FkBatch, FkOne, FkResult, FkStatus, IkBatch, IkOne, IkResult, IkStatus, Kernels
from teleop_core.robots.parts import ARGUMENT, ROBOTS, Part, RobotPart, built, from_file, is_urdf, part_name
from teleop_core.robots.robot import Robot

if TYPE_CHECKING:
    from teleop_core.robots.arms.dh import DhTable, load_table, parse_table, robot_from_table

__all__ = [
    "ROBOTS",
    "DhTable",
    "FkBatch",
    "FkOne",
    "FkResult",
    "FkStatus",
    "IkBatch",
    "IkOne",
    "IkResult",
    "IkStatus",
    "Kernels",
    "Robot",
    "RobotPart",
    "list_robots",
    "load_robot",
    "load_robot_set",
    "load_table",
    "parse_table",
    "register_robot",
    "robot_from_table",
]
_OF_TABLES = ("DhTable", "load_table", "parse_table", "robot_from_table")


def __getattr__(name: str) -> object:
    """Load tables on first use, so that importing robots stays cheap."""
    if name in _OF_TABLES:
        from teleop_core.robots.arms import dh

        return getattr(dh, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def list_robots() -> tuple[str, ...]:
    """Names that :func:`load_robot` knows: built in, installed, registered."""
    return ROBOTS.names()


def register_robot(robot: Part, name: str | None = None, *, replace: bool = False) -> Part:
    """Give a robot a name for the rest of this program.

    Args:
        robot: A :class:`Robot`, a :class:`~teleop_core.robots.arms.dh.DhTable`, or a function
            ``make(**geometry)`` that returns a robot and whose parameters all have defaults.
        name: Name of the robot in configurations; None for ``robot.name``.
        replace: Whether ``robot`` may replace a robot of this name that this program registered before.

    Returns:
        The same robot, so that this function can be used as a decorator.

    Raises:
        PartError: The name is taken, the object is not a robot, or its kernels do not run.
    """
    ROBOTS.add(part_name(robot) if name is None else name, robot, replace=replace)
    return robot


def load_robot(name: str, **geometry: float | str) -> Robot:
    """Robot by name.

    Args:
        name: One of :func:`list_robots`, or the path of a URDF, which ends in ``.urdf`` or
            ``.xacro``, or of a Denavit-Hartenberg table, which ends in ``.yaml`` or ``.yml``.
        **geometry: Lengths and angles [m, rad] that replace the published ones, by the symbols in the robot's file.
            Some robots also take named options, such as ``heading="carried"``. A URDF takes ``tip="tool0"`` and
            ``task="x y z"`` (:func:`teleop_core.robots.files.from_urdf.load_urdf`). A xacro also takes its own
            arguments, such as ``**{"xacro.prefix": "left_"}``. Tables and ready-made registered robots take no
            geometry.

    Returns:
        The robot.

    Raises:
        UnknownNameError: There is no such robot or symbol; the message lists the alternatives.
        ParameterError: A length is impossible, or a table contains an impossible entry.
        PartError: A robot of another package cannot be loaded.
        OSError: A table cannot be read.

    Warns:
        TeleopWarning: A URDF may use another unit, or its tip cannot move in all directions.
    """
    robot = _loaded(name, geometry)
    if is_urdf(name):
        from teleop_core.robots.robot_notes import notes_on_robot

        for note in notes_on_robot(robot, name, "task" in geometry):
            warnings.warn(note, TeleopWarning, stacklevel=2)
    return robot


def _loaded(name: str, geometry: Mapping[str, float | str]) -> Robot:
    return from_file(name, geometry) or built(name, ROBOTS.find(name), geometry)


def load_robot_set(name: str, settings: Iterable[str]) -> Robot:
    """Load a robot by name, with its geometry as texts ``symbol=value`` and without warnings.

    Args:
        name: As in :func:`load_robot`.
        settings: Lengths and angles [m, rad] such as ``L6=0.04``, options such as
            ``heading=carried``, or arguments of a xacro such as ``xacro.prefix=left_``.

    Returns:
        The robot.

    Raises:
        ParameterError: A text contains no "="; and all errors of :func:`load_robot`.
    """
    return _loaded(name, geometry_of(settings))


def geometry_of(settings: Iterable[str]) -> dict[str, float | str]:
    """Geometry for :func:`load_robot` from texts ``symbol=value``.

    Texts of numbers are converted to numbers; arguments of a xacro stay texts.

    Raises:
        ParameterError: A text contains no "=".
    """
    geometry: dict[str, float | str] = {}
    for text in settings:
        symbol, equals, value = text.partition("=")
        if not equals:
            raise ParameterError("geometry", text, "symbol=value, such as L6=0.04")
        name = symbol.strip()
        geometry[name] = value.strip()
        if not name.startswith(ARGUMENT):
            with suppress(ValueError):
                geometry[name] = float(value)
    return geometry
