"""Stewart-Gough platform: a body on six legs of any layout (6-UPS).

A :class:`Layout` contains the twelve joint points and computes leg lengths of a pose, the pose of leg lengths from a
seed, the leg Jacobian and its rank. On an architecturally singular layout, such as two similar hexagons one above the
other, the legs determine the platform in no pose; direct kinematics then returns a status instead.

As a robot, q is the six leg lengths, the tip is the platform frame, and ``fk`` is direct kinematics from the home pose:
the level platform ``z0`` above the base. If the wanted pose does not belong to the assembly nearest to home, ``ik``
returns the leg lengths of the wanted pose and UNREACHABLE. If there is no assembly near home, :meth:`Robot.fk`
searches, and :meth:`Robot.fk_all` finds up to 40. On an architecturally singular layout the legs determine no pose.
Then :meth:`Robot.solve_fk` returns UNDETERMINED, ``fk`` and ``jacobian`` raise errors, their kernels write NaN, and
``ik`` returns NEAR_SINGULAR. ``load_robot("stewart", **layout.symbols())`` takes any layout.

Source:
    Stewart 1965; Ghosal 2020, lecture 11; Merlet 2006 for the Jacobian and its singularities.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from teleop_core import kinematics
from teleop_core.base import ParameterError, ShapeError
from teleop_core.kernels import Array, checked_array, inner, is_rigid, kernel, length
from teleop_core.kinematics import branches
from teleop_core.kinematics.damped import is_near_singular
from teleop_core.robots.robot import Robot, geometry_of
from teleop_machines.bodies.parallel import stewart_bodies
from teleop_machines.drives import electric_cylinders
from teleop_machines.stewart_legs import CLOSED, direct, invert, leg_system, moved
from teleop_machines.stewart_search import NEAR, close_legs, closing_poses

# A leg Jacobian counts as singular if its smallest singular value, divided by the largest, is smaller.
_RANK = 1e-10
_FOLLOWED, _LIMITED = int(kinematics.IkStatus.FOLLOWED), int(kinematics.IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = (int(kinematics.IkStatus.NEAR_SINGULAR), int(kinematics.IkStatus.UNREACHABLE))


class DirectStatus(IntEnum):
    """Status of direct kinematics."""

    SOLVED = 0  # the pose has these leg lengths
    NEAR_SINGULAR = 1  # the pose has these leg lengths, but the legs hardly determine it
    CANNOT_ASSEMBLE = 2  # no pose was found from this seed; the pose of least error is returned
    ARCHITECTURALLY_SINGULAR = 3  # the legs of this layout determine no pose; the seed is returned


class DirectResult(NamedTuple):
    """Result of :meth:`Layout.direct`."""

    T: Array
    """``T_base_platform`` (4, 4)."""
    status: DirectStatus
    residual: float
    """Largest error of a leg length [m]."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Joint points of six legs, (6, 3): ``base`` in base coordinates, ``platform`` in platform coordinates."""

    base: Array
    platform: Array

    def __post_init__(self) -> None:
        for name in ("base", "platform"):
            points = checked_array(name, getattr(self, name), (6, 3)).copy()
            if points.shape != (6, 3):
                raise ShapeError(name, (6, 3), points.shape)
            object.__setattr__(self, name, points)
        if self.size == 0.0:
            raise ParameterError("platform", self.platform.tolist(), "points apart from the origin")

    @classmethod
    def circular(cls, r_b: float, base_angles: Array, r_m: float, platform_angles: Array) -> "Layout":
        """Joints on circles of radius ``r_b``, ``r_m`` [m] at angles (6,) [rad]."""
        return cls(*(_circle(r, a) for r, a in ((r_b, base_angles), (r_m, platform_angles))))

    @property
    def size(self) -> float:
        """Largest distance of a platform joint from the platform's origin [m]."""
        return float(length(self.platform).max())

    def symbols(self) -> dict[str, float]:
        """Geometry for ``load_robot``: b1x ... b6z, m1x ... m6z [m]."""
        points = np.concatenate((self.base, self.platform)).ravel()
        return dict(zip(_POINTS, points.tolist(), strict=True))

    def legs(self, T: object) -> Array:
        """Leg lengths (6,) [m] of a pose ``T_base_platform`` (4, 4); every pose has leg lengths."""
        return self._system(T)[0]

    def leg_jacobian(self, T: object) -> Array:
        """Jacobian (6, 6) from the twist of the platform (linear, then angular, in base axes) to the leg speeds."""
        return self._system(T)[1]

    def singular_values(self, T: object) -> Array:
        """Singular values (6,) of the leg Jacobian, largest first; rotations are weighted by the size."""
        weight = np.repeat([1.0, 1.0 / self.size], 3)
        return np.linalg.svd(self.leg_jacobian(T) * weight, compute_uv=False)

    def rank(self, T: object) -> int:
        """Rank of the leg Jacobian; below 6 the legs do not hold the platform."""
        values = self.singular_values(T)
        return int((values > _RANK * values[0]).sum())

    @property
    def is_architecturally_singular(self) -> bool:
        """Whether the legs hold the platform in no pose; eight poses in general position are tried."""
        rng = np.random.default_rng(0)
        start, T = np.eye(4), np.empty((4, 4))
        for _ in range(8):
            shift = rng.uniform(-0.5, 0.5, 3) + np.array([0.0, 0.0, 2.0])
            moved(start, np.concatenate((self.size * shift, rng.uniform(-1.0, 1.0, 3))), T)
            if self.rank(T) == 6:
                return False
        return True

    def direct(self, lengths: object, seed: object) -> DirectResult:
        """Pose with the given leg lengths, in the assembly that is found from a seed.

        Args:
            lengths: Leg lengths (6,) [m], not negative.
            seed: ``T_base_platform`` (4, 4) to start from.

        Returns:
            :class:`DirectResult`; if no pose has these lengths, no error is raised.

        Raises:
            ShapeError: ``lengths`` is not (6,), or ``seed`` is not (4, 4).
            ParameterError: A length is negative or not finite, or the seed is not a rigid transform.
        """
        wanted, T = checked_array("lengths", lengths, (6,)), _rigid("seed", seed).copy()
        if wanted.ndim != 1:
            raise ShapeError("lengths", (6,), wanted.shape)
        if wanted.min() < 0.0:
            raise ParameterError("lengths", wanted.tolist(), ">= 0 m")
        if self.is_architecturally_singular:
            gap = float(np.abs(self.legs(T) - wanted).max())
            return DirectResult(T, DirectStatus.ARCHITECTURALLY_SINGULAR, gap)
        gap = direct(wanted, self.base, self.platform, self.size, False, T)
        if gap > CLOSED:
            return DirectResult(T, DirectStatus.CANNOT_ASSEMBLE, gap)
        values = self.singular_values(T)
        is_near = values[-1] < NEAR * values[0]
        return DirectResult(T, DirectStatus.NEAR_SINGULAR if is_near else DirectStatus.SOLVED, gap)

    def _system(self, T: object) -> tuple[Array, Array]:
        lengths, J = np.empty(6), np.empty((6, 6))
        leg_system(_rigid("T", T), self.base, self.platform, lengths, J)
        return lengths, J


def _rigid(name: str, T: object) -> Array:
    pose = checked_array(name, T, (4, 4))
    if pose.ndim != 2:
        raise ShapeError(name, (4, 4), pose.shape)
    if not is_rigid(pose):
        raise ParameterError(name, pose.tolist(), "a rigid transform")
    return pose


def _circle(radius: float, angles: Array) -> Array:
    return np.stack((radius * np.cos(angles), radius * np.sin(angles), 0.0 * angles), axis=-1)


_POINTS = tuple(f"{body}{i}{axis}" for body in "bm" for i in range(1, 7) for axis in "xyz")
# The lecture publishes no layout. Radii and height are those of the hybrid of Kucuk and Gungor. Joints are paired at
# 15° on either side of 0, 120, 240° (base) and 60, 180, 300° (platform).
PAIRED = Layout.circular(
    0.2,
    np.radians([15.0, 105.0, 135.0, 225.0, 255.0, 345.0]),
    0.1,
    np.radians([45.0, 75.0, 165.0, 195.0, 285.0, 315.0]),
)
GEOMETRY = {**PAIRED.symbols(), "z0": 0.2}
_Z0, _SIZE, _SINGULAR, _SIDE = 36, 37, 38, 39
_UNDETERMINED = int(kinematics.FkStatus.UNDETERMINED)


@inner
def _at_home(geometry: Array, T: Array) -> None:
    """Write the home pose (4, 4): level, ``z0`` above the base."""
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    T[2, 3] = geometry[_Z0]


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip`` (4, 4) of leg lengths (6,) [m], found from the home pose.

    If no pose closes near home, the pose of least error is written; :func:`assemble` reports this. Measured for legal
    legs with joints in pairs, this happens for no pose rotated by up to 1 rad. It happens for 0.2 % of the poses
    rotated by up to 1.3 rad, and for 8 % of those rotated by up to half a turn.
    """
    _at_home(geometry, T)
    base, platform = geometry[:18].reshape((6, 3)), geometry[18:36].reshape((6, 3))
    direct(q, base, platform, geometry[_SIZE], False, T)
    if geometry[_SINGULAR] > 0.0:
        T[:3, :4] = math.nan


@kernel
def assemble(q: Array, geometry: Array, ask: Array, T: Array, out: Array) -> int:
    """Write ``T_base_tip`` of leg lengths (6,) [m]; see :class:`kinematics.Kernels`."""
    base, platform = geometry[:18].reshape((6, 3)), geometry[18:36].reshape((6, 3))
    side = 0.0
    if ask[1] == 0.0:
        _at_home(geometry, T)
        side = geometry[_SIDE]
    if geometry[_SINGULAR] > 0.0:
        lengths = np.empty(6)
        leg_system(T, base, platform, lengths, np.empty((6, 6)))
        out[0], out[1] = np.abs(lengths - q).max(), 0.0
        return _UNDETERMINED
    status = close_legs(q, base, platform, geometry[_SIZE], int(ask[0]), side, T, out)
    out[1] *= geometry[_SIDE]
    return status


@kernel
def assemblies(q: Array, geometry: Array, found: Array) -> int:
    """Write all ``T_base_tip`` of leg lengths (6,) [m]; see :class:`kinematics.Kernels`."""
    if geometry[_SINGULAR] > 0.0:
        return 0
    base, platform = geometry[:18].reshape((6, 3)), geometry[18:36].reshape((6, 3))
    return closing_poses(q, base, platform, geometry[_SIZE], kinematics.SEARCH_ALL, found)


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the Jacobian (6, 6): the inverse of the leg Jacobian at the pose of :func:`assemble`."""
    T, legs, lengths = np.empty((4, 4)), np.empty((6, 6)), np.empty(6)
    assemble(q, geometry, np.array((float(kinematics.SEARCH), 0.0)), T, np.empty(2))
    base, platform = geometry[:18].reshape((6, 3)), geometry[18:36].reshape((6, 3))
    leg_system(T, base, platform, lengths, legs)
    invert(legs, J)
    if geometry[_SINGULAR] > 0.0:
        J[:] = math.nan


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write leg lengths (6,) [m]; see :class:`teleop_core.robots.robot.Kernels`.

    Each leg has one solution; speed limits slow all legs by one factor.
    """
    if not kinematics.is_askable(T, seed):
        return -1
    base, platform = geometry[:18].reshape((6, 3)), geometry[18:36].reshape((6, 3))
    size, legs, reached = geometry[_SIZE], np.empty((6, 6)), np.empty((4, 4))
    leg_system(T, base, platform, q, legs)
    is_there = branches.slowed(q, seed, limits, q)
    if geometry[_SINGULAR] > 0.0:
        # These are the legs of the pose, although they do not determine it; within limits, they are the legs of a
        # nearby pose.
        reached[:] = T
        direct(q, base, platform, size, False, reached)
        kinematics.pose_residual(reached, T, residual)
        return _NEAR_SINGULAR if is_there else _LIMITED
    fk(q, geometry, reached)
    if not kinematics.pose_residual(reached, T, residual):
        return _UNREACHABLE if is_there else _LIMITED
    is_near = is_near_singular(legs.T, 1.0 / size, NEAR * 2.0 * size)
    return _NEAR_SINGULAR if is_near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write the leg lengths (1, 6) of the pose; return the number of solutions, 1."""
    base, platform = geometry[:18].reshape((6, 3)), geometry[18:36].reshape((6, 3))
    leg_system(T, base, platform, solutions[0], np.empty((6, 6)))
    return 1


def make(**geometry: float | str) -> Robot:
    """Platform with joints b1x ... b6z, m1x ... m6z and home height z0 [m]."""
    row = geometry_of(GEOMETRY, geometry)
    points = np.array(list(row.values())[:36]).reshape(2, 6, 3)
    layout = Layout(points[0], points[1])
    home = np.eye(4)
    home[2, 3] = row["z0"]
    lengths = layout.legs(home)
    if lengths.min() < kinematics.REACHED:
        raise ParameterError("z0", row["z0"], "a height at which no leg has length zero")
    row["size"] = layout.size
    row["is_singular"] = float(layout.is_architecturally_singular)
    row["side"] = float(np.linalg.slogdet(layout.leg_jacobian(home))[0])
    drives = electric_cylinders(6)
    return Robot(
        name="stewart",
        joint_names=tuple(f"leg{i}" for i in range(1, 7)),
        lower=0.6 * lengths,  # assumed strokes
        upper=1.5 * lengths,
        home=lengths,
        geometry=row,
        kernels=kinematics.Kernels(
            fk=fk, jacobian=jacobian, ik=ik, ik_all=ik_all, assemble=assemble, assemblies=assemblies
        ),
        drives=drives,
        describe=stewart_bodies,
    )
