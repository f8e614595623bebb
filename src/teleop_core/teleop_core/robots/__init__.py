"""Robots: one file each, one interface; ``load_robot("rcrt1")`` and ``list_robots()``."""

from importlib import import_module

from teleop_core.errors import UnknownNameError
from teleop_core.robots.robot import IkResult, IkStatus, Robot

__all__ = ["IkResult", "IkStatus", "Robot", "list_robots", "load_robot"]

# Name of the robot -> module of this package whose make(**geometry) builds it.
_MODULES = {
    "rcrt1": "rcrt1",
    "mma": "mma",
    "four_bar": "four_bar",
    "parallelogram": "parallelogram",
    "stewart": "stewart",
    "rps3": "rps3",
    "puma560": "puma560",
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
