"""Device axes: how the frame of a device lies, from three motions of its stylus.

The axes of ``master_base`` are those of a person before the device: x to the right, y up, z towards
the person.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.chain.mapping.parameters import axis_map
from teleop_core.kernels.geometry import checked_array
from teleop_core.kernels.portable import length

MOTIONS = ("to the right", "up", "towards you")
"""Which way to move the stylus: along x, y and z of ``master_base``."""
WAY = 0.1
"""How far, about [m]."""
UNITS = (1.0, 0.01, 0.001)
"""Lengths in which devices count: metres, centimetres, millimetres [m]."""
_STRAIGHT = 0.85  # least part of a motion along one axis: 32 degrees off it


@dataclass(frozen=True)
class DeviceAxes:
    """What a device says of its own frame.

    Attributes:
        axes: The x, y, z of ``master_base`` as axes of the device, such as ``("+y", "+z", "+x")``.
        unit: Length in which the device counts [m].
    """

    axes: tuple[str, ...]
    unit: float


def axis_of(way: object) -> str:
    """Axis of the device along which a motion went, such as ``-y``.

    Args:
        way: From the begin of the motion to its end, (3,) in the device's unit.

    Raises:
        ParameterError: It went nowhere, or along two axes alike.
    """
    moved = checked_array("way", way, (3,))
    size = float(length(moved))
    largest = int(np.argmax(np.abs(moved)))
    if not size > 0.0 or abs(float(moved[largest])) < _STRAIGHT * size:
        text = "a motion along one axis of the device: straighter, and farther"
        raise ParameterError("way", moved.tolist(), text)
    return ("-" if moved[largest] < 0.0 else "+") + "xyz"[largest]


def device_axes(ways: Sequence[object], asked: float = WAY) -> DeviceAxes:
    """Axes and unit of a device from three motions, those of :data:`MOTIONS`.

    Args:
        ways: From the begin of each motion to its end, three of (3,) in the device's unit.
        asked: How far each was asked to be, about [m].

    Raises:
        ParameterError: A motion is no straight one, two went along the same axis, or the frame is a
            left-handed one, which cannot be told by turns.
    """
    axes = tuple(map(axis_of, ways))
    if len({axis[-1] for axis in axes}) < len(axes):
        raise ParameterError("ways", axes, "three motions along three axes")
    try:
        axis_map("axes", axes)
    except ParameterError as error:
        text = "a right-handed frame; have the driver send one, as frames of ROS are"
        raise ParameterError("axes", axes, text) from error
    middle = float(np.median([length(checked_array("way", way, (3,))) for way in ways]))
    unit = min(UNITS, key=lambda unit: abs(math.log(unit * middle / asked)))
    return DeviceAxes(axes, unit)
