"""Master-slave teleoperation: haptic master, motion scaling, inverse kinematics, 1 kHz slave.

Folders follow the data: ``master`` -> ``mapping`` -> ``robots`` -> ``slave`` -> ``bags`` ->
``evaluation``; ``session`` wires them, ``nodes`` puts them on ROS 2 topics.
"""

from typing import Any

__version__ = "0.1.0"
__all__ = ["__version__", "list_robots", "load_robot"]


def __getattr__(name: str) -> Any:
    """Load the robots on first use, so that importing the package stays cheap."""
    if name in {"load_robot", "list_robots"}:
        from teleop_core import robots

        return getattr(robots, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
