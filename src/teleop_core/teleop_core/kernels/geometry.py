"""Geometry: rotations, poses and transforms as small compiled kernels.

A *pose* is a row of seven numbers, position x, y, z [m] and unit quaternion w, x, y, z. A *transform* is a (4, 4)
homogeneous matrix; ``T_base_tip`` maps tip coordinates to base coordinates.
"""

import math

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import ParameterError, ShapeError
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.portable import arctangent, dot, length
from teleop_core.kernels.room import room

Array = NDArray[np.float64]


@kernel
def rotation_from_quaternion(quaternion: Array, rotation: Array) -> None:
    """Write the rotation matrix (3, 3) of a unit quaternion w, x, y, z into ``rotation``."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    rotation[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    rotation[0, 1] = 2.0 * (x * y - w * z)
    rotation[0, 2] = 2.0 * (x * z + w * y)
    rotation[1, 0] = 2.0 * (x * y + w * z)
    rotation[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    rotation[1, 2] = 2.0 * (y * z - w * x)
    rotation[2, 0] = 2.0 * (x * z - w * y)
    rotation[2, 1] = 2.0 * (y * z + w * x)
    rotation[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@kernel
def quaternion_from_rotation(rotation: Array, quaternion: Array) -> None:
    """Write the unit quaternion w, x, y, z (w >= 0) of a rotation matrix into ``quaternion``.

    The largest of the four components is computed first, so that no rotation loses digits (Shepperd 1978).
    """
    r00, r11, r22 = rotation[0, 0], rotation[1, 1], rotation[2, 2]
    if r00 + r11 + r22 > 0.0:
        w, x = 1.0 + r00 + r11 + r22, rotation[2, 1] - rotation[1, 2]
        y, z = rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    elif r00 >= r11 and r00 >= r22:
        w, x = rotation[2, 1] - rotation[1, 2], 1.0 + r00 - r11 - r22
        y, z = rotation[1, 0] + rotation[0, 1], rotation[0, 2] + rotation[2, 0]
    elif r11 >= r22:
        w, x = rotation[0, 2] - rotation[2, 0], rotation[1, 0] + rotation[0, 1]
        y, z = 1.0 - r00 + r11 - r22, rotation[2, 1] + rotation[1, 2]
    else:
        w, x = rotation[1, 0] - rotation[0, 1], rotation[0, 2] + rotation[2, 0]
        y, z = rotation[2, 1] + rotation[1, 2], 1.0 - r00 - r11 + r22
    scale = math.copysign(1.0 / math.sqrt(w * w + x * x + y * y + z * z), w)
    quaternion[0], quaternion[1] = w * scale, x * scale
    quaternion[2], quaternion[3] = y * scale, z * scale


@kernel
def multiply_quaternions(a: Array, b: Array, product: Array) -> None:
    """Write the quaternion of rotation ``b`` followed by ``a`` into ``product`` (may be a or b)."""
    w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    product[0], product[1], product[2], product[3] = w, x, y, z


@kernel
def invert_quaternion(quaternion: Array, inverse: Array) -> None:
    """Write the quaternion of the inverse rotation into ``inverse`` (may be the same array)."""
    inverse[0] = quaternion[0]
    for i in range(1, 4):
        inverse[i] = -quaternion[i]


@kernel
def rotate_by_vector(quaternion: Array, rx: float, ry: float, rz: float, rotated: Array) -> None:
    """Rotate ``quaternion`` by a rotation vector [rad] in its own frame; the result is written to ``rotated``."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    half = 0.5 * angle
    # sin(x)/x loses no digits above this bound; below it 1 is exact to rounding.
    s = 0.5 * (math.sin(half) / half if half > 1e-8 else 1.0)
    turn = room(4)
    turn[0], turn[1], turn[2], turn[3] = math.cos(half), s * rx, s * ry, s * rz
    multiply_quaternions(quaternion, turn, rotated)


@kernel
def transform_from_pose(pose: Array, transform: Array) -> None:
    """Write the (4, 4) transform of a pose (7,) into ``transform``."""
    rotation_from_quaternion(pose[3:7], transform)
    for i in range(3):
        transform[i, 3] = pose[i]
        transform[3, i] = 0.0
    transform[3, 3] = 1.0


@kernel
def pose_from_transform(transform: Array, pose: Array) -> None:
    """Write the pose (7,) of a (4, 4) transform into ``pose``."""
    for i in range(3):
        pose[i] = transform[i, 3]
    quaternion_from_rotation(transform, pose[3:7])


@inner
def compose(a: Array, b: Array, product: Array) -> None:
    """Write the transform ``a @ b`` (4, 4) into ``product``, which must be another array than ``a`` and ``b``."""
    for i in range(3):
        for j in range(4):
            product[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]
        product[i, 3] += a[i, 3]
        product[3, i] = 0.0
    product[3, 3] = 1.0


@inner
def rotation_angle_between(a: Array, b: Array) -> float:
    """Angle [rad] of the rotation between two matrices; exact for small and for large angles."""
    trace, square = 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        twice_sine = 0.0  # part about axis i, from the skew part of aᵀ b
        for row in range(3):
            trace += a[row, i] * b[row, i]
            twice_sine += a[row, k] * b[row, j] - a[row, j] * b[row, k]
        square += twice_sine * twice_sine
    return math.atan2(0.5 * math.sqrt(square), 0.5 * (trace - 1.0))


@kernel
def rotation_vector_between(a: Array, b: Array, vector: Array) -> None:
    """Write the rotation vector (3,) [rad] from rotation ``a`` to rotation ``b``, in the base, into ``vector``.

    For half a turn, whose axis has two directions, the result may have either direction.
    """
    qa, qb = room(4), room(4)
    quaternion_from_rotation(a, qa)
    quaternion_from_rotation(b, qb)
    turn_between(qa, qb, vector)


@kernel
def turn_between(a: Array, b: Array, vector: Array) -> None:
    """Write the rotation vector (3,) [rad] from quaternion ``a`` to ``b``, in the base, into ``vector``."""
    turn = room(4)
    invert_quaternion(a, turn)
    multiply_quaternions(b, turn, turn)
    _vector_of(turn, vector)


@kernel
def turn_within(a: Array, b: Array, vector: Array) -> None:
    """Write the rotation vector (3,) [rad] from quaternion ``a`` to ``b``, in the frame of ``a``, into ``vector``."""
    turn = room(4)
    invert_quaternion(a, turn)
    multiply_quaternions(turn, b, turn)
    _vector_of(turn, vector)


@inner
def _vector_of(turn: Array, vector: Array) -> None:
    sign = -1.0 if turn[0] < 0.0 else 1.0
    sine = math.sqrt(turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3])
    scale = 2.0 * sign
    if sine > 1e-8:
        scale = 2.0 * sign * math.atan2(sine, sign * turn[0]) / sine
    for i in range(3):
        vector[i] = scale * turn[1 + i]


@kernel
def turn_by(vector: Array, quaternion: Array) -> None:
    """Rotate ``quaternion`` in place by a rotation vector (3,) [rad] in the base."""
    turn, unit = room(4), np.zeros(4)
    unit[0] = 1.0
    rotate_by_vector(unit, vector[0], vector[1], vector[2], turn)
    multiply_quaternions(turn, quaternion, quaternion)


@kernel
def is_rigid(transform: Array) -> bool:
    """Whether a (4, 4) matrix is finite and contains a right-handed rotation, within 1e-6.

    The rotation is right-handed if two columns are perpendicular unit vectors and the third is their cross product. A
    NaN or infinity anywhere makes a comparison fail.
    """
    first, second, cosine, third = -1.0, -1.0, 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        x, y = transform[i, 0], transform[i, 1]
        first += x * x
        second += y * y
        cosine += x * y
        cross = transform[j, 0] * transform[k, 1] - transform[k, 0] * transform[j, 1]
        third += (cross - transform[i, 2]) ** 2
        if not math.isfinite(transform[i, 3]) or transform[3, i] != 0.0:
            return False
    off = first * first + second * second + cosine * cosine + third
    return off <= 2e-12 and transform[3, 3] == 1.0


def rotation(axis: str, angle: float) -> Array:
    """Rotation matrix (3, 3) about the coordinate axis "x", "y" or "z" by ``angle`` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def transform(rotation: Array, position: Array) -> Array:
    """Homogeneous transform (4, 4) from a rotation (3, 3) and a position (3,) [m]."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation, position
    return out


def roll_pitch_yaw(rotations: Array) -> Array:
    """Fixed angles (..., 3) [rad] of rotations (..., 3, 3): R = Rz(roll) Ry(pitch) Rx(yaw).

    The names follow the RCRT-1 source, which calls the rotation about z roll. At pitch = ±90°, where only a sum or
    difference of roll and yaw is defined, yaw is 0.

    Source:
        Craig 2005, fixed angles.
    """
    r = rotations
    cosine = np.hypot(r[..., 0, 0], r[..., 1, 0])
    is_degenerate = cosine < 1e-9
    roll = np.where(is_degenerate, arctangent(-r[..., 0, 1], r[..., 1, 1]), arctangent(r[..., 1, 0], r[..., 0, 0]))
    pitch = arctangent(-r[..., 2, 0], cosine)
    yaw = np.where(is_degenerate, 0.0, arctangent(r[..., 2, 1], r[..., 2, 2]))
    return np.stack((roll, pitch, yaw), axis=-1)


def rotations_from_quaternions(quaternions: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4) in the order w, x, y, z."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_products(a: Array, b: Array) -> Array:
    """Quaternions (N, 4), w, x, y, z, of rotations ``b`` followed by ``a``; either may be (4,)."""
    w, x, y, z = np.moveaxis(np.asarray(a), -1, 0)
    p, q, r, s = np.moveaxis(np.asarray(b), -1, 0)
    rows = (
        w * p - x * q - y * r - z * s,
        w * q + x * p + y * s - z * r,
        w * r - x * s + y * p + z * q,
        w * s + x * r - y * q + z * p,
    )
    return np.stack(rows, axis=-1)


def continuous(quaternions: Array, last: Array | None) -> Array:
    """The same rotations (N, 4) with signs chosen so that no quaternion jumps, beginning after ``last``."""
    if not len(quaternions):
        return quaternions
    first = quaternions[:1] if last is None else last[None]
    before = np.concatenate((first, quaternions[:-1]))
    flips = np.where((quaternions * before).sum(axis=1) < 0.0, -1.0, 1.0)
    signed: Array = quaternions * np.cumprod(flips)[:, None]
    return signed


def framed_wrenches(wrench: Array, pose: Array) -> tuple[Array, Array]:
    """Wrench on a tip in the two frames that CRTK calls ``body`` and ``spatial``.

    Both wrenches have the same power ``f·v + t·w`` with the twist of their frame. The body twist is the velocity of
    the tip; the spatial twist is the velocity of the point of the tool that is at the base's origin.

    Args:
        wrench: Force [N] and torque about the tip [N·m] (6,), along the base's axes.
        pose: Pose of the tip in the base (7,).

    Returns:
        The body wrench along the tip's axes, with the torque about the tip; and the spatial wrench along the base's
        axes, with the torque about the base's origin.

    Source:
        Murray, Li and Sastry 1994, section 2.5.
    """
    turn = rotations_from_quaternions(pose[3:])
    force, torque = wrench[:3], wrench[3:]
    body = np.concatenate(((turn.T * force).sum(axis=1), (turn.T * torque).sum(axis=1)))
    return body, np.concatenate((force, torque + np.cross(pose[:3], force)))


def rotation_vectors(quaternions: Array) -> Array:
    """Rotations from the first of a series of unit quaternions (N, 4), w, x, y, z, to each of them.

    Returns:
        Rotation vectors (N, 3) [rad] in the axes of the first orientation. They continue beyond half a turn, up to a
        whole turn.
    """
    signs = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    q = quaternions * np.concatenate(([1.0], np.cumprod(signs)))[:, None]
    w, axis = q[0, 0], q[0, 1:]
    turned = w * q[:, 1:] - q[:, :1] * axis - np.cross(axis, q[:, 1:])
    sine = length(turned)
    angle = 2.0 * arctangent(sine, dot(q, q[0]))
    return turned * (angle / np.where(sine > 0.0, sine, 1.0))[:, None]


def checked_array(name: str, value: object, shape: tuple[int, ...]) -> Array:
    """Writable float array of the wanted trailing shape; a leading batch axis is allowed.

    Raises:
        ShapeError: The array does not have the wanted shape.
        ParameterError: A value is NaN or infinite.
    """
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.shape[-len(shape) :] != shape or array.ndim > len(shape) + 1:
        raise ShapeError(name, shape, array.shape)
    if not np.isfinite(array).all():
        raise ParameterError(name, "an array with NaN or infinity", "finite")
    return array if array.flags.writeable else array.copy()
