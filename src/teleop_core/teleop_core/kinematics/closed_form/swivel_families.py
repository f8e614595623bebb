"""Families of rotations of a swivel: rotations of the shoulder, and of the wrist, as functions of psi.

An arm of seven axes with a spherical shoulder and wrist can turn its elbow about the line between shoulder and wrist
while its tip does not move (:mod:`teleop_core.kinematics.closed_form.swivel`). Then the rotation of the shoulder is P
cos psi + Q sin psi + N. The rotation of the wrist has the same form with other matrices.

Source:
    Shimizu, Kakuya, Yoon, Kitagaki and Kosuge 2008, IEEE T-RO 24(5), section on the arm angle.
"""

import math

from teleop_core.kernels import Array, inner
from teleop_core.kernels.room import room
from teleop_core.kinematics.closed_form.subproblems import one_angle

F1, F2, F3, F4, F5 = (39, 51, 63, 75, 87)
"""Indices, in the constants, of the transforms after joints 1 to 5."""


@inner
def turned_about_z(K: Array, at: int, q: float, M: Array, out: Array) -> None:
    """Write M Rz(q) F, where F is the rotation at index ``at`` in the constants."""
    c, s = math.cos(q), math.sin(q)
    for i in range(3):
        x, y, z = c * M[i, 0] + s * M[i, 1], c * M[i, 1] - s * M[i, 0], M[i, 2]
        for j in range(3):
            out[i, j] = x * K[at + j] + y * K[at + 4 + j] + z * K[at + 8 + j]


@inner
def elbow_of(G: Array, K: Array, seed: float) -> tuple[float, float, float]:
    """Base and spread of joint 4 [rad], and 1.0 if the arm reaches the distance."""
    k0 = K[F3] * K[F3 + 3] + K[F3 + 4] * K[F3 + 7] + K[F3 + 8] * K[F3 + 11]
    k1 = K[F3 + 1] * K[F3 + 3] + K[F3 + 5] * K[F3 + 7] + K[F3 + 9] * K[F3 + 11]
    k2 = K[F3 + 2] * K[F3 + 3] + K[F3 + 6] * K[F3 + 7] + K[F3 + 10] * K[F3 + 11]
    x, y, z, square = K[F4 + 3], K[F4 + 7], K[F4 + 11], 0.0
    for i in range(3):
        a, b = K[F3 + 3 + 4 * i], K[F4 + 3 + 4 * i]
        square += G[i, 3] * G[i, 3] - a * a - b * b
    return one_angle(k0 * x + k1 * y, k1 * x - k0 * y, 0.5 * square - k2 * z, seed)


@inner
def _least_turn(v: Array, p: Array, A: Array, out: Array) -> None:
    """Write R A, where R is the smallest rotation of the direction of A v to the direction of p."""
    a, size, other = room(3), 0.0, 0.0
    for i in range(3):
        a[i] = A[i, 0] * v[0] + A[i, 1] * v[1] + A[i, 2] * v[2]
        size += a[i] * a[i]
        other += p[i] * p[i]
    over = 1.0 / max(math.sqrt(size * other), 1e-300)
    x, y, z = a[1] * p[2] - a[2] * p[1], a[2] * p[0] - a[0] * p[2], a[0] * p[1] - a[1] * p[0]
    x, y, z = over * x, over * y, over * z
    cosine = over * (a[0] * p[0] + a[1] * p[1] + a[2] * p[2])
    share = 1.0 / max(1.0 + cosine, 1e-12)
    for j in range(3):
        u, v0, w = A[0, j], A[1, j], A[2, j]
        along = share * (x * u + y * v0 + z * w)
        out[0, j] = cosine * u + y * w - z * v0 + along * x
        out[1, j] = cosine * v0 + z * u - x * w + along * y
        out[2, j] = cosine * w + x * v0 - y * u + along * z


@inner
def families(G: Array, K: Array, fourth: float, A: Array, work: Array, S: Array, W: Array) -> None:
    """Write P, Q, N of the shoulder's rotation into S (9, 3), and those of the wrist's rotation into W (9, 3).

    ``A`` is the shoulder's rotation at the seed; ``work`` (12, 3) is scratch memory.
    """
    B, C, D, v, p = work[:3], work[3:6], work[6:9], work[9], work[10]
    c, s, size = math.cos(fourth), math.sin(fourth), 0.0
    x, y, z = c * K[F4 + 3] - s * K[F4 + 7], s * K[F4 + 3] + c * K[F4 + 7], K[F4 + 11]
    for i in range(3):
        k = F3 + 4 * i
        v[i] = K[k] * x + K[k + 1] * y + K[k + 2] * z + K[k + 3]
        p[i] = G[i, 3]
        size += p[i] * p[i]
        for j in range(3):
            B[i, j] = K[k + j]
    _least_turn(v, p, A, D)
    turned_about_z(K, F4, fourth, B, C)
    over = 1.0 / max(math.sqrt(size), 1e-300)
    x, y, z = over * p[0], over * p[1], over * p[2]
    for j in range(3):
        along = x * D[0, j] + y * D[1, j] + z * D[2, j]
        S[6, j], S[7, j], S[8, j] = along * x, along * y, along * z
        for i in range(3):
            S[i, j] = D[i, j] - S[6 + i, j]
        S[3, j] = y * D[2, j] - z * D[1, j]
        S[4, j] = z * D[0, j] - x * D[2, j]
        S[5, j] = x * D[1, j] - y * D[0, j]
    for f in range(0, 9, 3):  # (A C)ᵀ G of each part
        for i in range(3):
            for j in range(3):
                B[i, j] = S[f + i, 0] * C[0, j] + S[f + i, 1] * C[1, j] + S[f + i, 2] * C[2, j]
        for i in range(3):
            for j in range(3):
                W[f + i, j] = B[0, i] * G[0, j] + B[1, i] * G[1, j] + B[2, i] * G[2, j]


@inner
def triple_product(K: Array, at: int, middle: float) -> float:
    """Volume spanned by three meeting unit axes, between -1 and 1; 0 if they are coplanar.

    ``at`` is the index of the transform after the first axis, ``middle`` the angle of the second.
    """
    r0, r1, a0, a1 = K[at + 8], K[at + 9], K[at + 14], K[at + 18]
    a, b = r0 * a0 + r1 * a1, r1 * a0 - r0 * a1
    return b * math.cos(middle) - a * math.sin(middle)
