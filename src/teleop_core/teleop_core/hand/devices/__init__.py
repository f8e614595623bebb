"""Devices: input devices of this machine, a gamepad or a 3-D mouse, read as rates and buttons.

This package can be imported without their libraries, which are the extra ``devices``.
"""

from teleop_core.hand.input_device import NOTHING, Device, DeviceReading

__all__ = ["NOTHING", "Device", "DeviceReading"]
