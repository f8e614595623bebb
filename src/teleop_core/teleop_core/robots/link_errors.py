"""Link errors: how a built arm differs from its drawing, as deltas of Denavit-Hartenberg numbers.

Link i of a chain is T_i = Rz(theta) Tz(d) Tx(a) Rx(alpha), the standard convention. The built arm has theta plus the
error of theta, and so on. A joint offset is an error of theta for a turning joint, and an error of d for a sliding
joint. :func:`~teleop_core.robots.arms.as_chain.true_chain` returns the geometry row of the arm as built, for which
:func:`teleop_core.kinematics.dh_kernels.fk` computes the true pose of the tip::

    errors = LinkErrors.of(robot, {"d3": 5.5e-3})
    dh_kernels.fk(q, true_chain(robot, errors), T_base_tip)

Arms described in other conventions are converted to the standard convention. Every pair of successive axes has a common
normal, which points to the later axis; a is the length along it. For parallel axes any common normal is taken. The four
numbers then cannot describe a small rotation of the later axis out of the plane of the two axes (Hayati and Mirmirani
1985). So these numbers do not cover all errors of a pair of nearly parallel axes.

Source:
    Denavit and Hartenberg 1955; Mooring, Roth and Driels 1991, Fundamentals of manipulator calibration.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

from teleop_core.base import ParameterError, UnknownNameError
from teleop_core.kernels import Array, inverse_motion, product, rotation, transform
from teleop_core.robots import arm, drives

SYMBOLS = ("a", "alpha", "d", "theta")
"""Kinds of errors. A vector of errors is sorted by kind: first a1 ... an, then alpha1 ... alphan, then d and theta."""
_PARALLEL = 1e-9  # axes with a smaller sine of the angle between them count as parallel
_ONE_LINE = 1e-12  # parallel axes with a smaller distance count as one line [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkErrors:
    """Errors of each link's Denavit-Hartenberg numbers: value as built minus value as drawn; read-only copies.

    Args:
        a: Errors of the length along the common normal, (n,) [m].
        alpha: Errors of the twist about the common normal, (n,) [rad].
        d: Errors of the distance along the joint's axis, (n,) [m]; the offset of a sliding joint.
        theta: Errors of the angle about the joint's axis, (n,) [rad]; the offset of a turning joint.

    Raises:
        ShapeError: The arguments are not four vectors of equal length.
        ParameterError: A value is NaN or infinite.
    """

    a: Array
    alpha: Array
    d: Array
    theta: Array

    def __post_init__(self) -> None:
        for name in SYMBOLS:
            values = drives.read_only(name, getattr(self, name), np.shape(self.a))
            object.__setattr__(self, name, values)

    @property
    def n(self) -> int:
        """Number of links."""
        return len(self.a)

    @property
    def vector(self) -> Array:
        """All errors (4n,) in the order of :func:`error_names`; a new array each time."""
        return np.concatenate([getattr(self, name) for name in SYMBOLS])

    def named(self) -> dict[str, float]:
        """Errors that are not zero, by name [m, rad]."""
        names = error_names(self.n)
        return {k: float(v) for k, v in zip(names, self.vector, strict=True) if v != 0.0}

    @staticmethod
    def from_vector(vector: Array) -> "LinkErrors":
        """Errors of a vector (4n,) in the order of :func:`error_names`."""
        parts = np.asarray(vector, dtype=np.float64).reshape(4, -1)
        return LinkErrors(a=parts[0], alpha=parts[1], d=parts[2], theta=parts[3])

    @staticmethod
    def none(n: int) -> "LinkErrors":
        """An arm of ``n`` links that is built as drawn."""
        return LinkErrors.from_vector(np.zeros(4 * n))

    @staticmethod
    def of(robot: arm.Arm, given: Mapping[str, float]) -> "LinkErrors":
        """Errors by name, such as ``{"d3": 5.5e-3}``; all others are zero.

        Raises:
            UnknownNameError: No error has this name; the message lists the names.
            ParameterError: A value is not finite.
        """
        names = error_names(robot.n)
        vector = np.zeros(len(names))
        for name, value in given.items():
            if name not in names:
                raise UnknownNameError("link error", name, names)
            if not isinstance(value, int | float) or not math.isfinite(value):
                raise ParameterError(f"link error {name}", value, "a finite number [m or rad]")
            vector[names.index(name)] = value
        return LinkErrors.from_vector(vector)


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """A serial arm T_base_tip = F0 J1 F1 J2 ... Jn Fn; each Ji is a motion about or along the local z axis.

    Args:
        kinds: Kind of each joint as in :mod:`~teleop_core.kinematics.dh_kernels`, (n,).
        fixed: Transforms F0 ... Fn, (n + 1, 4, 4).
        row: Geometry row of the kernels.
    """

    kinds: Array
    fixed: Array
    row: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.kinds)

    def built(self, errors: LinkErrors) -> Array:
        """Geometry row of the arm with these errors; without errors, the row of the drawing.

        Link i becomes Ji Rz(theta) Tz(d) Fi Si⁻¹ Tx(a) Rx(alpha) Si, where theta, d, a and alpha are the errors alone.
        Si is the part of Fi that moves along the axis of the next joint.
        """
        row = self.row.copy()
        for i in range(self.n):
            before, after = _errors_of_link(errors, i)
            S = next_axis_motion(self.fixed[i + 1])
            link = reduce(product, (before, self.fixed[i + 1], inverse_motion(S), after, S))
            is_drawn = not any(getattr(errors, name)[i] for name in SYMBOLS)
            at = self.n + 7 + 12 * (i + 1)
            row[at : at + 12] = (self.fixed[i + 1] if is_drawn else link)[:3].ravel()
        return row


def _errors_of_link(errors: LinkErrors, i: int) -> tuple[Array, Array]:
    """Two errors of a link as transforms (4, 4): along and about z, and along and about x."""
    along_z = transform(rotation("z", errors.theta[i]), np.array([0.0, 0.0, errors.d[i]]))
    along_x = transform(rotation("x", errors.alpha[i]), np.array([errors.a[i], 0.0, 0.0]))
    return along_z, along_x


def next_axis_motion(F: Array) -> Array:
    """Motion S = Rz Tz (4, 4) that ends F = Rz(theta) Tz(d) Tx(a) Rx(alpha) S.

    Parallel axes, whose common normal may lie anywhere, get d = 0 in S. For intersecting axes, the direction of the
    normal with the smaller rotation in S is taken.

    Source:
        Derived; the third row of a rotation is sin(alpha) sin(turn), sin(alpha) cos(turn), cos.
    """
    R, p = F[:3, :3], F[:3, 3]
    sine = math.hypot(R[2, 0], R[2, 1])
    if sine < _PARALLEL:
        total = math.atan2(R[1, 0], R[0, 0])
        theta = math.atan2(p[1], p[0]) if math.hypot(p[0], p[1]) > _ONE_LINE else 0.0
        turn = total - theta if R[2, 2] > 0.0 else theta - total
        return transform(rotation("z", turn), np.zeros(3))
    turn = math.atan2(R[2, 0], R[2, 1])
    if abs(turn) > 0.5 * math.pi + _PARALLEL:  # the normal in the opposite direction
        turn, sine = turn - math.copysign(math.pi, turn), -sine
    # The first column of Rz(theta) is the first column of R, rotated back.
    normal = product(R, rotation("z", -turn)[:, 0])
    slide = (normal[1] * p[0] - normal[0] * p[1]) / sine
    return transform(rotation("z", turn), np.array([0.0, 0.0, slide]))


def error_names(n: int) -> tuple[str, ...]:
    """Names of all errors of ``n`` links: a1 ... an, alpha1 ..., d1 ..., theta1 ... thetan."""
    return tuple(f"{symbol}{i + 1}" for symbol in SYMBOLS for i in range(n))
