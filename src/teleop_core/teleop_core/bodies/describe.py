"""Describing robots: which description of its bodies a robot has."""

from collections.abc import Callable
from importlib import import_module
from weakref import WeakKeyDictionary

from teleop_core.bodies.body import Bodies
from teleop_core.bodies.serial import serial_bodies
from teleop_core.bodies.unknown import unknown_bodies
from teleop_core.robots.robot import Robot

# Robots whose joints are no chain, by the module of their kernels, with what describes them.
_LOOPS = {
    "teleop_core.robots.stewart": "parallel:stewart_bodies",
    "teleop_core.robots.rps3": "parallel:rps3_bodies",
    "teleop_core.robots.scara_stewart": "hybrid:scara_stewart_bodies",
    "teleop_core.robots.four_bar": "planar:four_bar_bodies",
    "teleop_core.robots.parallelogram": "planar:parallelogram_bodies",
    "teleop_core.robots.mma": "mma:mma_bodies",
    "teleop_core.robots.mma_forward": "mma:mma_bodies",
    "teleop_core.robots.three_finger_hand": "hand:hand_bodies",
}
_KNOWN: "WeakKeyDictionary[Robot, Bodies]" = WeakKeyDictionary()


def bodies_of(robot: Robot) -> Bodies:
    """Bodies of a robot: the same object each time it is asked for the same robot.

    Robots with loops of the registry have descriptions of their own; of every other robot whose
    joints are a chain the axes follow from its kinematics. What is neither, such as a parallel
    robot of somebody else, is drawn as its base, a dotted line, and its tip.
    """
    if robot not in _KNOWN:
        _KNOWN[robot] = _described(robot)
    return _KNOWN[robot]


def _described(robot: Robot) -> Bodies:
    place = _LOOPS.get(robot.kernels.fk.__module__)
    if place is not None:
        module, _, name = place.partition(":")
        describe: Callable[[Robot], Bodies] = getattr(
            import_module(f"teleop_core.bodies.{module}"), name
        )
        return describe(robot)
    return serial_bodies(robot) or unknown_bodies(robot)
