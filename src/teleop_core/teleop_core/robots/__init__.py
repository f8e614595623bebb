"""Robots: one file each, one interface; ``load_robot("rcrt1")`` and ``list_robots()``."""

from collections.abc import Iterable
from importlib import import_module

from teleop_core.errors import ParameterError, UnknownNameError
from teleop_core.robots.kinematics import IkResult, IkStatus
from teleop_core.robots.robot import Robot

__all__ = ["IkResult", "IkStatus", "Robot", "list_robots", "load_robot", "load_robot_set"]

# Name of the robot -> module of this package whose make(**geometry) builds it.
_MODULES = {
    "rcrt1": "rcrt1",
    "mma": "mma",
    "four_bar": "four_bar",
    "parallelogram": "parallelogram",
    "stewart": "stewart",
    "rps3": "rps3",
    "scara_stewart": "scara_stewart",
    "three_finger_hand": "three_finger_hand",
    "puma560": "puma560",
    "scara": "scara",
    "planar_3r": "planar_3r",
    "five_axis": "five_axis",
}


def list_robots() -> tuple[str, ...]:
    """Names that :func:`load_robot` knows."""
    return tuple(_MODULES)


def load_robot(name: str, **geometry: float | str) -> Robot:
    """Robot by name.

    Args:
        name: One of :func:`list_robots`.
        **geometry: Lengths and angles in place of the published ones [m, rad], by the symbols of
            the robot's file; a robot may take named options too, such as ``heading="carried"``.

    Returns:
        The robot.

    Raises:
        UnknownNameError: No such robot or no such symbol; the alternatives are listed.
        ParameterError: A length is not possible.
    """
    if name not in _MODULES:
        raise UnknownNameError("robot", name, _MODULES)
    robot: Robot = import_module(f"{__name__}.{_MODULES[name]}").make(**geometry)
    return robot


def load_robot_set(name: str, settings: Iterable[str]) -> Robot:
    """Robot by name, with its geometry as texts ``symbol=value``: how parameters give it.

    Args:
        name: One of :func:`list_robots`.
        settings: Lengths and angles [m, rad] such as ``L6=0.04``, or options such as
            ``heading=carried``.

    Returns:
        The robot.

    Raises:
        UnknownNameError: As :func:`load_robot`.
        ParameterError: As :func:`load_robot`; or a text without "=".
    """
    geometry: dict[str, float | str] = {}
    for text in settings:
        symbol, equals, value = text.partition("=")
        if not equals:
            raise ParameterError("geometry", text, "symbol=value, such as L6=0.04")
        try:
            geometry[symbol.strip()] = float(value)
        except ValueError:
            geometry[symbol.strip()] = value.strip()
    return load_robot(name, **geometry)
