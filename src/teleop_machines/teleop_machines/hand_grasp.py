"""Grasp of the three-fingered hand: contact points, object pose, and joints that hold the object.

The base of finger 1 is at (0, -d, h), of finger 2 at (0, d, h), of the thumb at the origin; the thumb's frame is
rotated by gamma about y. The object is the equilateral triangle of the contact points with side ``side``:
origin at its centre, x towards contact 1, z normal.

Source:
    Ghosal 2020, lectures 6 and 11, after Salisbury 1982.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from teleop_core.base import ParameterError, ShapeError
from teleop_core.kernels import Array, checked_array, inner, is_rigid, kernel
from teleop_core.kinematics import REACHED
from teleop_core.robots.robot import geometry_of
from teleop_machines.hand_fingers import Triple, finger_branch, finger_jacobian, finger_point
from teleop_machines.rps3_loop import COSINES, SINES, frame

FINGERS = 3
# No lengths are published; with these lengths the hand holds an object of 5 cm.
GEOMETRY = {
    "l11": 0.03, "l12": 0.05, "l13": 0.04,
    "l21": 0.03, "l22": 0.05, "l23": 0.04,
    "l31": 0.03, "l32": 0.05, "l33": 0.04,
    "d": 0.03, "h": 0.08, "gamma": -0.3, "side": 0.05,
}  # fmt: skip
_D, _H, _GAMMA, SIDE = 9, 10, 11, 12


@inner
def _turned(i: int, g: Array, sign: float, x: float, y: float, z: float) -> Triple:
    """Rotate a vector from finger frame F_i to base axes (sign 1), or from base axes to F_i (sign -1)."""
    if i < FINGERS - 1:
        return x, y, z
    c, s = math.cos(g[_GAMMA]), sign * math.sin(g[_GAMMA])
    return c * x + s * z, y, c * z - s * x


@inner
def _base(i: int, g: Array) -> tuple[float, float]:
    """Position y, z of the base of finger i [m]."""
    if i == FINGERS - 1:
        return 0.0, 0.0
    return (g[_D] if i == 1 else -g[_D]), g[_H]


@inner
def links_of(i: int, g: Array) -> Triple:
    """Links of finger i [m]."""
    return g[3 * i], g[3 * i + 1], g[3 * i + 2]


@kernel
def contacts(q: Array, g: Array, points: Array) -> None:
    """Write the contact points (3, 3) [m] of nine joints, one row per finger."""
    for i in range(FINGERS):
        x, y, z = finger_point(q[3 * i], q[3 * i + 1], q[3 * i + 2], links_of(i, g))
        x, y, z = _turned(i, g, 1.0, x, y, z)
        base_y, base_z = _base(i, g)
        points[i, 0], points[i, 1], points[i, 2] = x, base_y + y, base_z + z


@kernel
def wanted_contact(i: int, T: Array, g: Array) -> Triple:
    """Position of contact i of the object at T [m], in base coordinates."""
    radius = g[SIDE] / math.sqrt(3.0)
    x, y = radius * COSINES[i], radius * SINES[i]
    return (
        T[0, 3] + T[0, 0] * x + T[0, 1] * y,
        T[1, 3] + T[1, 0] * x + T[1, 1] * y,
        T[2, 3] + T[2, 0] * x + T[2, 1] * y,
    )


@kernel
def local_point(i: int, g: Array, p: Triple) -> Triple:
    """Point of the base [m] in finger frame F_i."""
    base_y, base_z = _base(i, g)
    return _turned(i, g, -1.0, p[0], p[1] - base_y, p[2] - base_z)


@kernel
def contact_jacobian(q: Array, g: Array, J: Array) -> None:
    """Write the slopes (9, 9) of the contact points along the joints, one block per finger."""
    local = np.empty((3, 3))
    J[:] = 0.0
    for i in range(FINGERS):
        finger_jacobian(q[3 * i : 3 * i + 3], g[3 * i : 3 * i + 3], local)
        for j in range(3):
            x, y, z = _turned(i, g, 1.0, local[0, j], local[1, j], local[2, j])
            J[3 * i, 3 * i + j], J[3 * i + 1, 3 * i + j], J[3 * i + 2, 3 * i + j] = x, y, z


class Grasp(IntEnum):
    """Whether six actuated joints can hold the object."""

    HELD = 0  # the contacts keep their distances
    CANNOT_HOLD = 1  # no solution was found from the seed; the joints of least error are returned


class GraspResult(NamedTuple):
    """Result of :meth:`Hand.hold`."""

    q: Array
    """All nine joints [rad]."""
    status: Grasp
    residual: float
    """Largest error of a distance between contacts [m]."""


@dataclass(frozen=True, eq=False)
class Hand:
    """Computations for a hand with a robot's ``geometry``; points are in base coordinates [m]."""

    geometry: Mapping[str, float]
    _row: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        row = checked_geometry(self.geometry)
        object.__setattr__(self, "_row", np.array(list(row.values())))

    def contact_points(self, q: object) -> Array:
        """Contact points (3, 3), one row per finger, of nine joints [rad]."""
        points = np.empty((3, 3))
        contacts(_shaped("q", q, (9,)), self._row, points)
        return points

    def contacts_of(self, T: object) -> Array:
        """Contact points (3, 3) of the object at a pose ``T_base_object`` (4, 4)."""
        pose, points = _shaped("T", T, (4, 4)), np.empty((3, 3))
        if not is_rigid(pose):
            raise ParameterError("T", pose.tolist(), "a rigid transform")
        for i in range(FINGERS):
            points[i] = wanted_contact(i, pose, self._row)
        return points

    def object_pose(self, points: object) -> Array:
        """Pose ``T_base_object`` (4, 4) of the object at three contact points (3, 3)."""
        corners, T = _shaped("points", points, (3, 3)), np.empty((4, 4))
        area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
        if area <= 1e-9 * self._row[SIDE] ** 2:
            raise ParameterError("points", corners.tolist(), "the corners of a triangle")
        frame(corners, T)
        return T

    def finger_solutions(self, finger: int, point: object) -> Array:
        """All joints (k, 3) [rad], k <= 4, with which finger 1, 2 or 3 touches a point (3,)."""
        if finger not in {1, 2, 3}:
            raise ParameterError("finger", finger, "1, 2 or 3 (the thumb)")
        i, x = finger - 1, _shaped("point", point, (3,))
        local = local_point(i, self._row, (x[0], x[1], x[2]))
        links = tuple(self._row[3 * i : 3 * i + 3])
        found = np.array([finger_branch(local, links, k, 0.0) for k in range(4)])
        return found[found[:, 3] > 0.0, :3]

    def slip(self, q: object) -> Array:
        """Distances between the contacts minus the object's side, (3,) [m], for the pairs 12, 23 and 31."""
        points = self.contact_points(q)
        ends = np.roll(points, -1, axis=0)
        return np.linalg.norm(ends - points, axis=1) - self._row[SIDE]

    def hold(self, actuated: object, seed: object) -> GraspResult:
        """Passive third joints phi that let six actuated joints hold the object.

        Which two joints of a finger are actuated is not published: theta and psi are assumed.

        Args:
            actuated: theta and psi of each finger, (3, 2) [rad].
            seed: phi of each finger to start from, (3,) [rad].

        Returns:
            :class:`GraspResult`; joints that cannot hold the object are not an error.
        """
        q = np.column_stack((_shaped("actuated", actuated, (3, 2)), _shaped("seed", seed, (3,))))
        q = q.ravel()
        for _ in range(50):
            gap = self.slip(q)
            if np.abs(gap).max() <= 1e-14:
                break
            turn = np.linalg.lstsq(self._slip_slopes(q)[:, 2::3], -gap, rcond=1e-9)[0]
            q[2::3] += turn * min(1.0, 0.3 / max(np.abs(turn).max(), 1e-300))
        worst = float(np.abs(self.slip(q)).max())
        return GraspResult(q, Grasp.HELD if worst <= REACHED else Grasp.CANNOT_HOLD, worst)

    def _slip_slopes(self, q: Array) -> Array:
        """Slopes (3, 9) of :meth:`slip` along the joints [m/rad]."""
        points, J = self.contact_points(q), np.empty((9, 9))
        contact_jacobian(q, self._row, J)
        slopes = np.empty((3, 9))
        for i in range(FINGERS):
            k = (i + 1) % FINGERS
            way = points[k] - points[i]
            change = J[3 * k : 3 * k + 3] - J[3 * i : 3 * i + 3]
            slopes[i] = way @ change / np.linalg.norm(way)
        return slopes


def _shaped(name: str, value: object, shape: tuple[int, ...]) -> Array:
    array = checked_array(name, value, shape)
    if array.shape != shape:
        raise ShapeError(name, shape, array.shape)
    return array


def checked_geometry(given: Mapping[str, float | str]) -> dict[str, float]:
    """Default geometry, with the values of the given symbols replaced; lengths that are not > 0 are refused."""
    row = geometry_of(GEOMETRY, given)
    for symbol, value in row.items():
        is_link = symbol[0] == "l" and symbol[2] != "1"
        if (is_link or symbol == "side") and value <= 0.0:
            raise ParameterError(symbol, value, "a length > 0 m")
    return row
