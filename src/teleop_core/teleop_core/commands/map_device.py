"""``teleop map-device``: how the frame of a haptic device lies, from three motions."""

import argparse
import os
from pathlib import Path
from typing import Any

from teleop_core.commands.arguments import command, ros_module

_EPILOG = """\
finds axes and unit of a device whose driver says poses, and writes what master_bridge needs:
  teleop map-device /omni1/pose --out my_device.yaml
  master_bridge --ros-args --params-file my_device.yaml
known devices have a file each in config/masters.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "find the axes of a haptic device by three motions of its stylus"
    parser = command(commands, "map-device", _run, text)
    parser.epilog, parser.formatter_class = _EPILOG, argparse.RawDescriptionHelpFormatter
    parser.add_argument("topic", metavar="TOPIC", help="where its driver says poses")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.yaml", help="parameters of master_bridge (default: shown)"
    )
    parser.add_argument(
        "--domain", type=int, metavar="N", help="ROS domain (default: ROS_DOMAIN_ID, or 0)"
    )


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.chain.master.device_axes import MOTIONS, WAY, axis_of, device_axes

    listener = ros_module("device_listener").DeviceListener
    domain = arguments.domain
    domain = int(os.environ.get("ROS_DOMAIN_ID", "0")) if domain is None else domain
    with listener(arguments.topic, domain) as device:
        print(f"{device.topic} says {device.message}; sit before the device, each motion {WAY} m")
        ways = []
        for motion in MOTIONS:
            _ask("hold the stylus still, then press Enter")
            begin = device.place()
            _ask(f"move it {motion}, hold it there, then press Enter")
            ways.append(device.place() - begin)
            print(f"that was {axis_of(ways[-1])} of the device")
        found = device_axes(ways)
        text = _parameters(device.topic, device.message, found.axes, found.unit)
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")
        print(f"{arguments.out}: master_bridge --ros-args --params-file {arguments.out}")
    return 0


def _ask(text: str) -> None:
    """Wait for Enter.

    Raises:
        SessionError: Nobody is there to press it.
    """
    from teleop_core.base.errors import SessionError

    try:
        input(f"{text} ")
    except EOFError as error:
        raise SessionError("three motions need a person who presses Enter") from error


def _parameters(topic: str, message: str, axes: tuple[str, ...], unit: float) -> str:
    named = ", ".join(f'"{axis}"' for axis in axes)
    return (
        "# Found by teleop map-device. Buttons and forces: docs/real_masters.md.\n"
        "master_bridge:\n  ros__parameters:\n"
        f"    pose_topic: {topic}\n    pose_message: {message}\n"
        f"    device_axes: [{named}]\n    unit: {unit!r}\n"
    )
