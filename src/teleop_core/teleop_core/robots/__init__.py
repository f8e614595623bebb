"""Robots: one interface for every arm, whether built in, described by a table or your own.

``load_robot("rcrt1")`` takes a name of :func:`list_robots` or the path of a Denavit-Hartenberg table. A table becomes a
robot with ``robot_from_table({...})``; :func:`register_robot`, or the entry-point group ``teleop_core.robots`` of an
installed package, gives a robot a name that ``--set robot=`` takes::

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
        name: Its name in configurations; None for its own name.
        replace: Whether it may replace a robot that this program registered before.

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
        **geometry: Lengths and angles that replace the published ones [m, rad], by the symbols of the robot's file; a
            robot may have named options too, such as ``heading="carried"``.
            A URDF takes ``tip="tool0"`` and ``task="x y z"``
            (:func:`teleop_core.robots.files.from_urdf.load_urdf`), and a xacro its own arguments,
            as ``**{"xacro.prefix": "left_"}``. Tables and robots that were registered ready-made
            take none.

    Returns:
        The robot.

    Raises:
        UnknownNameError: No such robot or no such symbol; the alternatives are listed.
        ParameterError: A length is not possible, or a table has an impossible entry.
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
    """Robot by name, with its geometry as texts ``symbol=value``; gives no warnings.

    Args:
        name: As in :func:`load_robot`.
        settings: Lengths and angles [m, rad] such as ``L6=0.04``, options such as
            ``heading=carried``, or arguments of a xacro such as ``xacro.prefix=left_``.

    Returns:
        The robot.

    Raises:
        ParameterError: A text without "="; and all errors of :func:`load_robot`.
    """
    return _loaded(name, geometry_of(settings))


def geometry_of(settings: Iterable[str]) -> dict[str, float | str]:
    """Geometry of :func:`load_robot` from texts ``symbol=value``; numbers become numbers.

    Arguments of a xacro stay texts.

    Raises:
        ParameterError: A text without "=".
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
