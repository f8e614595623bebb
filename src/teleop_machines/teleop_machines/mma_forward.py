"""Forward kinematics, Jacobian and loop closure of the MMA, in closed form.

Joint vector q = (θ1, θ2, θ3, θ3', θ6, θ8, θ10): yaw, shoulder pitch, the two links of the parallelogram against link 2,
and the three wrist axes. Abbreviations: index 23 means θ2 + θ3, index 23' means θ2 + θ3'.

Source:
    Singh 2014, tables 4.4 and 4.10, eqs. 4.43-4.81, misprints corrected.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel

# Lengths [m] in the symbols of table 4.4. They are magnitudes, so d7 and d9 enter tables with a minus. a3 is the long
# side of the parallelogram (a3' = a3'' in table 4.10) and d5 the sum of what table 4.10 calls a3 + a4'. theta12 is the
# fixed turn of the tool about its z axis [rad].
GEOMETRY = {
    "d1": 0.13777, "a2": 0.18746, "a3": 0.16076, "d5": 0.06782, "a5": 0.02011, "d7": 0.03507,
    "a7": 0.02524, "d9": 0.03840, "a9": 0.01609, "a11": 0.11873, "d11": 0.02729, "d12": 0.03650,
    "theta12": 0.0,
}  # fmt: skip
# Model A, the conventional table 4.1, lacks these four offsets, and its tool frame is rotated by 90°.
MODEL_A = {"a5": 0.0, "a7": 0.0, "a9": 0.0, "a11": 0.0, "theta12": 0.5 * math.pi}


@kernel
def groups(geometry: Array) -> tuple[float, float, float, float]:
    """Lengths H = d5 + a7, S = d7 + a9, F = d9 + a11, G = d11 + d12 [m]; the terms of a sum lie along one axis."""
    g = geometry
    return g[3] + g[6], g[5] + g[8], g[7] + g[9], g[10] + g[11]


@inner
def wrist_axes(q: Array, axes: Array) -> None:
    """Write columns of ``axes`` (3 or more rows and columns): col1, K, X in base axes.

    col1 has the opposite direction of axis 10, and K that of axis 8. K and X are columns 2 and 3 of the tool's rotation
    before the rotation by θ10.
    """
    c1, s1 = math.cos(q[0]), math.sin(q[0])
    c23, s23 = math.cos(q[1] + q[2]), math.sin(q[1] + q[2])
    c6, s6 = math.cos(q[4]), math.sin(q[4])
    c8, s8 = math.cos(q[5]), math.sin(q[5])
    U, V = s1 * c6 - c1 * s23 * s6, c1 * c6 + s1 * s23 * s6
    axes[0, 0] = c1 * c23 * s8 - c8 * U
    axes[1, 0] = s1 * c23 * s8 + c8 * V
    axes[2, 0] = -s23 * s8 + c23 * s6 * c8
    axes[0, 1] = s1 * s6 + c1 * s23 * c6
    axes[1, 1] = -c1 * s6 + s1 * s23 * c6
    axes[2, 1] = c23 * c6
    axes[0, 2] = c1 * c23 * c8 + s8 * U
    axes[1, 2] = s1 * c23 * c8 - s8 * V
    axes[2, 2] = -(s23 * c8 + c23 * s6 * s8)


@kernel
def fk(q: Array, geometry: Array, T: Array) -> None:
    """Write ``T_base_tip``, (4, 4), of joints (7,).

    Source:
        Singh 2014, eq. 4.81, g22 and g24 corrected.
    """
    wrist_axes(q, T)
    H, S, F, G = groups(geometry)
    c1, s1, c10, s10 = math.cos(q[0]), math.sin(q[0]), math.cos(q[6]), math.sin(q[6])
    a2, a3, a5 = geometry[1], geometry[2], geometry[4]
    radius = a2 * math.cos(q[1]) + a3 * math.cos(q[1] + q[3]) + H * math.cos(q[1] + q[2])
    fall = a2 * math.sin(q[1]) + a3 * math.sin(q[1] + q[3]) + H * math.sin(q[1] + q[2])
    T[0, 3] = c1 * radius + s1 * a5
    T[1, 3] = s1 * radius - c1 * a5
    T[2, 3] = geometry[0] - fall
    c12, s12 = math.cos(geometry[12]), math.sin(geometry[12])
    for i in range(3):
        column1, K, X = T[i, 0], T[i, 1], T[i, 2]
        column2, column3 = c10 * K - s10 * X, s10 * K + c10 * X
        T[i, 0], T[i, 1] = c12 * column1 + s12 * column2, c12 * column2 - s12 * column1
        T[i, 2] = column3
        T[i, 3] += S * K + F * column1 + G * column3
        T[3, i] = 0.0
    T[3, 3] = 1.0


@inner
def _turn(J: Array, column: int, axis: tuple[float, float, float], x: float, y: float, z: float) -> None:
    """Write the column of a joint that rotates about ``axis``; the lever arm to the tip is x, y, z [m]."""
    a, b, c = axis
    J[0, column], J[1, column], J[2, column] = b * z - c * y, c * x - a * z, a * y - b * x
    J[3, column], J[4, column], J[5, column] = a, b, c


@inner
def jacobian_at(q: Array, geometry: Array, T: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 7) for a known tip pose T; see :func:`jacobian`.

    The axes of the wrist are read from T: before θ10 and the fixed turn θ12 its columns are col1, K and X.
    """
    _, S, F, G = groups(geometry)
    x, y, z = T[0, 3], T[1, 3], T[2, 3] - geometry[0]
    c1, s1, c10, s10 = math.cos(q[0]), math.sin(q[0]), math.cos(q[6]), math.sin(q[6])
    c12, s12 = math.cos(geometry[12]), math.sin(geometry[12])
    c23, s23 = math.cos(q[1] + q[2]), math.sin(q[1] + q[2])
    c, s = geometry[2] * math.cos(q[1] + q[3]), geometry[2] * math.sin(q[1] + q[3])
    J[0, 3], J[1, 3], J[2, 3] = -c1 * s, -s1 * s, -c
    J[3, 3] = J[4, 3] = J[5, 3] = 0.0
    c += geometry[1] * math.cos(q[1])
    s += geometry[1] * math.sin(q[1])
    _turn(J, 0, (0.0, 0.0, 1.0), x, y, z)
    _turn(J, 1, (-s1, c1, 0.0), x, y, z)
    _turn(J, 2, (-s1, c1, 0.0), x - c1 * c, y - s1 * c, z + s)
    for i in range(3):
        col1, column2 = c12 * T[i, 0] - s12 * T[i, 1], s12 * T[i, 0] + c12 * T[i, 1]
        # Axes of joints 10 and 8. The column of joint 6 temporarily contains the lever arm of joint 10.
        J[3 + i, 6], J[3 + i, 5] = -col1, -(c10 * column2 + s10 * T[i, 2])
        J[3 + i, 4] = F * col1 + G * T[i, 2]
    x, y, z = J[3, 4], J[4, 4], J[5, 4]
    _turn(J, 6, (J[3, 6], J[4, 6], J[5, 6]), x, y, z)
    x, y, z = x - S * J[3, 5], y - S * J[4, 5], z - S * J[5, 5]
    _turn(J, 4, (c1 * c23, s1 * c23, -s23), x, y, z)
    _turn(J, 5, (J[3, 5], J[4, 5], J[5, 5]), x, y, z)


@kernel
def jacobian(q: Array, geometry: Array, J: Array) -> None:
    """Write the geometric Jacobian (6, 7): rows linear, then angular, in base axes.

    θ3' moves the tip without rotating it, because the parallelogram keeps link 4 parallel to link 3a. The rank is five
    if θ6 and θ8 are both ±90°, for any posture of the arm.
    """
    T = np.empty((4, 4))
    fk(q, geometry, T)
    jacobian_at(q, geometry, T, J)
