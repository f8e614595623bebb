"""Assembly modes of the 3-RPS: its leg chains, and every pose of three leg lengths.

Source:
    Lee and Shah 1988; Ghosal 2020, lectures 6 and 11; elimination derived from them.
"""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from teleop_core.base.errors import ParameterError, ShapeError
from teleop_core.kernels.geometry import Array, checked_array
from teleop_machines.rps3_loop import frame, points, settle

_CLOSED = 1e-10  # largest remaining error of the loop equations in an assembly mode, divided by a²


class Assembly(IntEnum):
    """Whether three leg lengths can be assembled."""

    CLOSED = 0
    CANNOT_ASSEMBLE = 1


class AssemblyModes(NamedTuple):
    """All poses of three leg lengths; k = 0 with status CANNOT_ASSEMBLE."""

    status: Assembly
    angles: Array
    """Leg angles theta (k, 3) [rad]; assemblies with the first leg above the base come first."""
    transforms: Array
    """``T_base_platform`` (k, 4, 4)."""


def joint_points(lengths: object, angles: object, *, b: float) -> Array:
    """Ball joints (3, 3) [m], one per row, from leg lengths [m] and angles [rad], (3,) each.

    Source:
        Ghosal 2020, lecture 6, Base_S1 to Base_S3.
    """
    out = np.empty((3, 3))
    points(_three("lengths", lengths), _three("angles", angles), b, out)
    return out


def leg_coordinates(ball_joints: object, *, b: float) -> tuple[Array, Array]:
    """Leg lengths (3,) [m] and angles (3,) [rad] of ball joints (3, 3) [m]."""
    S = checked_array("ball_joints", ball_joints, (3, 3))
    turn = 2.0 * math.pi / 3.0 * np.arange(3)
    inward = b - (S[:, 0] * np.cos(turn) + S[:, 1] * np.sin(turn))
    return np.hypot(inward, S[:, 2]), np.arctan2(S[:, 2], inward)


def assembly_modes(lengths: object, *, b: float, a: float) -> AssemblyModes:
    """All poses of the platform for three leg lengths.

    For a given theta1, two loop equations give theta2 and theta3 with two signs each. The product of the third
    equation's four sign variants and of the squared denominators is a polynomial of degree 8 in cos(theta1). Its real
    roots are refined by the loop equations.

    Args:
        lengths: Legs (3,) [m], > 0.
        b: Distance of the hinges from the base centre [m].
        a: Distance of the ball joints from the platform centre [m].

    Raises:
        ShapeError: ``lengths`` is not (3,).
        ParameterError: A length is not positive and finite.
    """
    legs = _three("lengths", lengths)
    if legs.min() <= 0.0:
        raise ParameterError("lengths", legs.tolist(), "> 0 m")
    nodes = chebyshev.chebpts1(9)
    polynomial = chebyshev.chebfit(nodes, _eliminant(nodes, legs, b, a), 8)
    found: list[Array] = []
    for x in chebyshev.chebroots(polynomial):
        if abs(x.imag) < 1e-3 and abs(x.real) < 1.0 + 1e-3:
            for start in _starts(min(max(x.real, -1.0), 1.0), legs, b, a):
                _collect(found, start, legs, b, a)
    found += [-angles for angles in found if np.abs(np.sin(angles)).max() > 1e-7]
    angles = np.array(found).reshape(-1, 3)
    transforms = np.empty((len(found), 4, 4))
    for theta, T in zip(angles, transforms, strict=True):
        frame(joint_points(legs, theta, b=b), T)
    status = Assembly.CLOSED if found else Assembly.CANNOT_ASSEMBLE
    return AssemblyModes(status, angles, transforms)


def _three(name: str, value: object) -> Array:
    array = checked_array(name, value, (3,))
    if array.ndim != 1:
        raise ShapeError(name, (3,), array.shape)
    return array


def _pair(x: Array, leg: float, other: float, b: float, a: float) -> tuple[Array, Array, Array]:
    """Coefficients of P cos + Q sin + R = 0 for the other leg's angle, at cos(theta1) = x."""
    P = other * (leg * x - 3.0 * b)
    Q = -2.0 * leg * other * np.sqrt(np.maximum(1.0 - x * x, 0.0))
    return P, Q, 3.0 * (b * b - a * a) + leg**2 + other**2 - 3.0 * b * leg * x


def _variants(x: Array, legs: Array, b: float, a: float) -> tuple[Array, Array, Array, Array]:
    """Cosine and sine of theta2 (2, ...) and theta3 (2, ...), complex where they do not exist."""
    out: list[Array] = []
    for other in legs[1:]:
        P, Q, R = _pair(x, legs[0], other, b, a)
        square = P * P + Q * Q
        root = np.sqrt(square - R * R + 0.0j)
        out.append(np.stack([(-P * R - s * Q * root) / square for s in (1, -1)]))
        out.append(np.stack([(-Q * R + s * P * root) / square for s in (1, -1)]))
    return out[0], out[1], out[2], out[3]


def _eliminant(x: Array, legs: Array, b: float, a: float) -> Array:
    """Product of the four variants of the third loop equation at cos(theta1) = x, times the denominators."""
    cosine2, sine2, cosine3, sine3 = _variants(x, legs, b, a)
    _, l2, l3 = legs
    product = np.ones_like(x, dtype=complex)
    for i in range(2):
        for j in range(2):
            product *= (
                3.0 * (b * b - a * a)
                + l2**2
                + l3**2
                - 3.0 * b * (l2 * cosine2[i] + l3 * cosine3[j])
                + l2 * l3 * (cosine2[i] * cosine3[j] - 2.0 * sine2[i] * sine3[j])
            )
    for other in legs[1:]:
        P, Q, _ = _pair(x, legs[0], other, b, a)
        product *= (P * P + Q * Q) ** 2
    return np.asarray(product.real)


def _starts(x: float, legs: Array, b: float, a: float) -> list[Array]:
    """Leg angles (3,) of the four variants at cos(theta1) = x, theta1 >= 0."""
    values = [part.real for part in _variants(np.array(x), legs, b, a)]
    second, third = np.arctan2(values[1], values[0]), np.arctan2(values[3], values[2])
    return [np.array([math.acos(x), second[i], third[j]]) for i in range(2) for j in range(2)]


def _collect(found: list[Array], start: Array, legs: Array, b: float, a: float) -> None:
    """Refine leg angles and add them with theta1 >= 0, unless they are already known or are no solution."""
    theta = start.copy()
    if settle(legs, b, a, theta) > _CLOSED * a * a:
        return
    theta = np.arctan2(np.sin(theta), np.cos(theta))
    if theta[0] < 0.0:
        theta = -theta
    if all(np.abs(np.exp(1j * theta) - np.exp(1j * other)).max() > 1e-6 for other in found):
        found.append(theta)
