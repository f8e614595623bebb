"""``teleop map-device``: how the frame of a haptic device lies, and its joints, from motions."""

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError, SessionError
from teleop_core.commands.arguments import command, geometry_argument, ros_module

if TYPE_CHECKING:
    from teleop_core.chain.master.device_axes import DeviceAxes
    from teleop_core.chain.master.device_joints import DeviceJoints
    from teleop_core.kernels.geometry import Array

_EPILOG = """\
finds axes and unit of a device whose driver says poses, and writes what master_bridge needs:
  teleop map-device /omni1/pose --out my_device.yaml
of one whose driver says joints it first finds which is which, and how it turns:
  teleop map-device /leader/joint_states --handle so101.urdf --geometry tip=gripper_frame_link
  master_bridge --ros-args --params-file my_device.yaml
known devices have a file each in config/masters.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "find the axes of a haptic device by three motions of its stylus"
    parser = command(commands, "map-device", _run, text, _EPILOG)
    parser.add_argument("topic", metavar="TOPIC", help="where its driver says poses, or joints")
    parser.add_argument(
        "--handle", default="", metavar="ROBOT",
        help="robot whose tip is the stylus, by name or file, where the driver says joints",
    )  # fmt: skip
    geometry_argument(parser)
    parser.add_argument(
        "--out", type=Path, metavar="FILE.yaml", help="parameters of master_bridge (default: shown)"
    )
    parser.add_argument(
        "--domain", type=int, metavar="N", help="ROS domain (default: ROS_DOMAIN_ID, or 0)"
    )


def _run(arguments: argparse.Namespace) -> int:
    listener = ros_module("device_listener").DeviceListener
    domain = arguments.domain
    domain = int(os.environ.get("ROS_DOMAIN_ID", "0")) if domain is None else domain
    with listener(arguments.topic, domain) as device:
        print(f"{device.topic} says {device.message}")
        text = mapped(device, arguments.handle, arguments.geometry)
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")
        print(f"{arguments.out}: master_bridge --ros-args --params-file {arguments.out}")
    return 0


def mapped(device: Any, handle: str, geometry: list[str]) -> str:
    """Parameters of ``master_bridge`` for a device, as a file, from motions of a person.

    Args:
        device: A listener to the device, with its ``topic`` and ``message``, and with ``place()``
            or ``joints()``.
        handle: Robot whose tip is the stylus, for a device that says joints; else empty.
        geometry: Geometry of that robot.

    Raises:
        ParameterError: A motion along an axis was not straight, or the handle is missing, or one
            too many.
        SessionError: Nobody is there, or the device falls silent.
    """
    from teleop_core.chain.master.master_bridge import MasterBridgeParameters

    given: dict[str, Any] = {"pose_topic": device.topic, "pose_message": device.message}
    robot: dict[str, Any] = {"handle": handle, "handle_geometry": tuple(geometry)} if handle else {}
    MasterBridgeParameters(**given, **robot)  # refuses what does not fit
    if not handle:
        found = _axes(device.place)
        return _text(given | {"device_axes": found.axes, "unit": found.unit})
    joints = _joints(device, handle, geometry)
    found = _axes(lambda: joints.place(device.joints()))
    return _text(given | robot | vars(joints.parameters()) | {"device_axes": found.axes})


def _joints(device: Any, handle: str, geometry: list[str]) -> "DeviceJoints":
    """Joints of a device, each moved alone until it was."""
    from teleop_core.chain.master.device_joints import DeviceJoints
    from teleop_core.robots import load_robot_set

    robot = load_robot_set(handle, geometry)
    home = ", ".join(f"{n} {q:.3g}" for n, q in zip(robot.joint_names, robot.home, strict=True))
    print(f"home of {robot.name} [rad, m]: {home}")
    print("forward, left and up are x, y and z of its base")
    _ask("hold it as it is at home, then press Enter")
    found = DeviceJoints(robot, device.joints())
    while joint := found.joint:
        begin = device.joints()
        _ask(f"move {joint} alone, so that {found.way(begin)}, hold it there, then press Enter")
        try:
            print(f"that was {found.take(begin, device.joints())} of the device")
        except ParameterError as error:
            print(f"{error}; once more")
    return found


def _axes(place: "Callable[[], Array]") -> "DeviceAxes":
    """Axes and unit of a device from three motions of its stylus."""
    from teleop_core.chain.master.device_axes import MOTIONS, WAY, axis_of, device_axes

    print(f"sit before the device, each motion {WAY} m")
    ways = []
    for motion in MOTIONS:
        _ask("hold the stylus still, then press Enter")
        begin = place()
        _ask(f"move it {motion}, hold it there, then press Enter")
        ways.append(place() - begin)
        print(f"that was {axis_of(ways[-1])} of the device")
    return device_axes(ways)


def _ask(text: str) -> None:
    """Wait for Enter.

    Raises:
        SessionError: Nobody is there to press it.
    """
    try:
        input(f"{text} ")
    except EOFError as error:
        raise SessionError("motions need a person who presses Enter") from error


def _text(values: dict[str, Any]) -> str:
    """Parameters as a file; empty ones, which are the default, are left out."""
    import yaml

    plain = {n: list(v) if isinstance(v, tuple) else v for n, v in values.items() if v != ()}
    about = "# Found by teleop map-device. Buttons and forces: docs/real_masters.md.\n"
    body = {"master_bridge": {"ros__parameters": plain}}
    return about + yaml.safe_dump(body, sort_keys=False, allow_unicode=True)
