"""Device: measurements of the hand by the haptic master, which is a Phantom Omni or a jointed handle."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base import Within, fixed, parameter
from teleop_core.kernels import Fields, Quaternion, Vector3, inner, inverse_motion, kernel, product
from teleop_core.kernels.geometry import (
    Array,
    compose,
    multiply_quaternions,
    pose_from_transform,
    rotate_by_vector,
    transform_from_pose,
)
from teleop_core.kernels.room import room
from teleop_core.robots import load_robot_set

_OMNI = "published: Vongbunyong 2008, table 5.1"


@dataclass(frozen=True, kw_only=True)
class DeviceParameters:
    """Numbers of the Phantom Omni: published by its maker, derived or assumed."""

    workspace: tuple[float, ...] = parameter(
        (0.16, 0.12, 0.07),
        Within(0.01, 1.0, "m"),
        "width, height and depth of the space in which the tip can move",
        length=3,
        source=_OMNI,
    )
    start: tuple[float, ...] = fixed(
        (0.0, 0.0, -0.03),
        Within(-0.5, 0.5, "m"),
        "position of the inkwell relative to the middle of the workspace",
        length=3,
        source="assumed: the inkwell is behind the middle; no source gives the distance",
    )
    position_resolution: float = parameter(
        0.055e-3, Within(0.0, 1e-2, "m"), "step size of the position reading; 0: no steps", source=_OMNI
    )
    gimbal_noise: float = parameter(
        2e-3,
        Within(0.0, 0.1, "rad"),
        "largest noise of each gimbal potentiometer",
        source="derived: raw fluctuation of the slave's reference at rest (Vongbunyong 2008, "
        "section 6.2), not a specification of the potentiometers",
    )
    peak_force: float = parameter(
        3.3, Within(0.0, 50.0, "N"), "largest force that the device can give for a short time", source=_OMNI
    )
    continuous_force: float = parameter(
        0.88,
        Within(1e-3, 50.0, "N"),
        "largest RMS force that the device's motors can give continuously; peak_force or more: no limit",
        source=_OMNI,
    )
    thermal_time: float = parameter(
        60.0,
        Within(0.1, 1e4, "s"),
        "thermal time constant of the device's motors",
        source="assumed: between that of the winding (some 10 s) and that of the housing (some 100 s) "
        "of coreless motors of this size, by data sheets",
    )
    stiffness: tuple[float, ...] = parameter(
        (1260.0, 2310.0, 1020.0),
        Within(10.0, 1e7, "N/m"),
        "stiffness of the device between tip and motors, along x, y, z; it acts in series with every wall",
        length=3,
        source=_OMNI,
    )
    structure_damping: float = parameter(
        5.0,
        Within(0.0, 1e4, "N·s/m"),
        "damping of the device between tip and motors, in parallel with its stiffness",
        source="assumed: a quarter to a third of critical damping for apparent_mass on this stiffness",
    )
    apparent_mass: float = parameter(
        0.045, Within(1e-3, 5.0, "kg"), "apparent mass of the device at its tip", source=_OMNI
    )
    friction: float = parameter(
        0.26, Within(0.0, 5.0, "N"), "backdrive friction; a smaller force does not move the tip", source=_OMNI
    )
    handle: str = fixed("", doc="robot whose joints measure the hand's pose, such as mma; empty: the Phantom's joints")
    handle_geometry: tuple[str, ...] = fixed(
        (), doc="symbol=value for each length or option of the handle that differs from its default [m, rad]"
    )


class Handle(NamedTuple):
    """A jointed handle: its kinematics, the pose of its base, and its last joint positions."""

    ik: Any
    fk: Any
    limits: Array
    geometry: Array
    T_base_handle: Array
    T_handle_base: Array
    encoder_step: Array
    joints: Array
    q: Array


class ReadingState(Fields):
    """Fields of a state record with the last reading."""

    reading: Vector3  # [m]
    rate: Vector3  # [m/s]
    attitude: Quaternion
    turning: Vector3  # [rad/s]


@kernel
def read_phantom(device: DeviceParameters, position: Array, attitude: Array, noise: Array, pose: Array) -> None:
    """Write the pose (7,) that the Phantom reads: position in encoder steps, attitude with noise (3,)."""
    wobble = room(3)
    for i in range(3):
        pose[i] = position[i]
        if device.position_resolution > 0.0:
            pose[i] = round(position[i] / device.position_resolution) * device.position_resolution
        # The bound is taken as two standard deviations; larger noise is clipped to the bound.
        wobble[i] = device.gimbal_noise * min(max(0.5 * noise[i], -1.0), 1.0)
    rotate_by_vector(attitude, wobble[0], wobble[1], wobble[2], pose[3:7])


@kernel
def read_handle(handle: Handle, position: Array, attitude: Array, pose: Array) -> None:
    """Write the pose (7,) that a jointed handle reads: its joints in encoder steps, through fk.

    The hand moves the tip. The joint positions come from the inverse kinematics; of several solutions, the one nearest
    to the last sample is taken.
    """
    T, U, residual, q = room(4, 4), room(4, 4), room(2), handle.q
    for i in range(3):
        pose[i] = position[i]
    for i in range(4):
        pose[3 + i] = attitude[i]
    transform_from_pose(pose, T)
    compose(handle.T_handle_base, T, U)
    handle.ik(U, handle.joints, handle.limits, handle.geometry, q, residual)
    for i in range(q.shape[0]):
        handle.joints[i] = q[i]
        q[i] = round(q[i] / handle.encoder_step[i]) * handle.encoder_step[i]
    handle.fk(q, handle.geometry, U)
    compose(handle.T_base_handle, U, T)
    pose_from_transform(T, pose)


@inner
def measure_twist(s: ReadingState, pose: Array, twist: Array, dt: float) -> None:
    """Write the twist (6,) from two successive readings, through a 5 ms low-pass."""
    share = dt / (dt + 5e-3)
    for i in range(3):
        s.rate[i] += ((pose[i] - s.reading[i]) / dt - s.rate[i]) * share
        s.reading[i] = pose[i]
        twist[i] = s.rate[i]
    back = room(4)
    back[0] = s.attitude[0]
    for i in range(1, 4):
        back[i] = -s.attitude[i]
    multiply_quaternions(pose[3:7], back, back)
    sign = 1.0 if back[0] >= 0.0 else -1.0
    for i in range(3):
        # A small rotation vector between two samples is twice the vector part of the quaternion, in base axes.
        s.turning[i] += (sign * 2.0 * back[1 + i] / dt - s.turning[i]) * share
        twist[3 + i] = s.turning[i]
    for i in range(4):
        s.attitude[i] = pose[3 + i]


def make_handle(parameters: DeviceParameters, T_base_rest: Array) -> Handle | None:
    """First argument of :func:`read_handle` for the chosen handle; None for the Phantom.

    The base of the handle is placed so that its home pose is the rest pose of the stylus. So the same paths and the
    same motion scaling work for every device.

    Args:
        parameters: Parameters that name the handle.
        T_base_rest: Pose of the resting tip in the master's base (4, 4).

    Returns:
        The handle; its joints start at home.

    Raises:
        UnknownNameError: There is no such robot, or the robot has no such symbol.
    """
    if not parameters.handle:
        return None
    robot = load_robot_set(parameters.handle, parameters.handle_geometry)
    T_base_handle = product(T_base_rest, inverse_motion(robot.fk(robot.home)))
    step = np.full(robot.n, 1e-5) if robot.drives is None else robot.drives.encoder_step.copy()
    return Handle(
        robot.ik_pointer, robot.fk_pointer, robot.limits(), robot.geometry_row.copy(),
        T_base_handle, inverse_motion(T_base_handle), step, robot.home.copy(),
        np.zeros(robot.n),
    )  # fmt: skip
