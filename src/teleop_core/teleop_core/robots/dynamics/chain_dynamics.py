"""Dynamics of a chain of rigid bodies: Newton-Euler efforts, inertia matrix, and accelerations.

All motions and forces are written about the origin of the base and in its axes, so that the contributions of the links
add up without a change of frame. The parameter row contains, for n joints: the geometry of
:mod:`teleop_core.kinematics.dh_kernels`, gravity (3,) [m/s²], for each joint the thirteen numbers of the body that it
moves (:func:`body_row`), and the inertias (n,) of the motors at the joints.

Source:
    Luh, Walker and Paul 1980 (recursive Newton-Euler); Walker and Orin 1982 (composite bodies);
    Featherstone 2008, chapters 2, 5 and 6, for the spatial form.
"""

from collections.abc import Sequence

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import dh_kernels
from teleop_core.robots.drives import Dynamics
from teleop_core.robots.dynamics import rigid_body

GRAVITY = (0.0, 0.0, -9.81)
"""Acceleration of free fall in the base [m/s²]; the base is mounted upright, with z up."""
_BODY = 13


def body_row(mass: float, center: Array, inertia: Array) -> Array:
    """Numbers (13,) of a body: mass, mass times centre, inertia about the origin, row by row.

    Args:
        mass: [kg].
        center: Centre of mass (3,) in the frame of the body [m].
        inertia: Tensor (3, 3) about that *centre*, in the axes of the frame [kg·m²].
    """
    about_origin = inertia + mass * (np.eye(3) * (center**2).sum() - np.outer(center, center))
    return np.concatenate([[mass], mass * center, about_origin.ravel()])


def chain_row(kinds: Sequence[float], fixed: Sequence[Array], bodies: Array, motors: Array) -> Array:
    """Parameter row of the kernels below.

    Args:
        kinds: Kind of each joint: 1 for a turning, 2 for a sliding joint; negative if it moves against its axis.
        fixed: Transforms (4, 4) before, between and after the joints, n + 1 of them.
        bodies: For each joint, the body that it moves, in the frame after the joint, (n, 13); see :func:`body_row`.
        motors: Inertia of each motor at its joint (n,) [kg·m² or kg].

    Returns:
        (27 n + 22,).
    """
    frames = np.array([matrix[:3] for matrix in fixed])
    weights = np.ones(7)  # reach and controlled directions, which do not move anything
    return np.concatenate([kinds, weights, frames.ravel(), GRAVITY, bodies.ravel(), motors])


def chain_dynamics(row: Array) -> Dynamics:
    """Model of a chain with a row of :func:`chain_row`; the controller feeds all gravity forward."""
    n = (row.shape[0] - 22) // 27  # see chain_row
    return Dynamics(
        acceleration=chain_acceleration, gravity=chain_gravity, parameters=row, compensated=np.ones(n, np.bool_)
    )


@inner
def _place(q: Array, row: Array, axes: Array, bodies: Array) -> None:
    """Write the unit motion of each joint (n, 6), angular part first, and each body (n, 13), in the base."""
    n = q.shape[0]
    at = n + 7 + 12 * (n + 1) + 3
    T, R = np.empty((4, 4)), np.empty((3, 3))
    for i in range(4):
        for j in range(4):
            T[i, j] = 1.0 if i == j else 0.0
    dh_kernels.append_fixed(row, n, 0, T)
    for k in range(n):
        sign = 1.0 if row[k] > 0.0 else -1.0
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            if abs(row[k]) > 1.5:
                axes[k, i], axes[k, 3 + i] = 0.0, sign * T[i, 2]
            else:
                axes[k, i] = sign * T[i, 2]
                axes[k, 3 + i] = sign * (T[a, 3] * T[b, 2] - T[b, 3] * T[a, 2])
        dh_kernels.move_joint(row[k], q[k], T)
        _carry(T, row[at + _BODY * k : at + _BODY * (k + 1)], R, bodies[k])
        dh_kernels.append_fixed(row, n, k + 1, T)


@inner
def _carry(T: Array, own: Array, R: Array, body: Array) -> None:
    """Transform a body (13,) from a frame T (4, 4) to the origin of the base; R is scratch memory."""
    mass = body[0] = own[0]
    square = along = 0.0
    for i in range(3):
        body[1 + i] = T[i, 0] * own[1] + T[i, 1] * own[2] + T[i, 2] * own[3]
        square += mass * T[i, 3] * T[i, 3]
        along += 2.0 * T[i, 3] * body[1 + i]
        for j in range(3):
            R[i, j] = T[i, 0] * own[4 + j] + T[i, 1] * own[7 + j] + T[i, 2] * own[10 + j]
    for i in range(3):
        for j in range(3):
            turned = R[i, 0] * T[j, 0] + R[i, 1] * T[j, 1] + R[i, 2] * T[j, 2]
            turned -= mass * T[i, 3] * T[j, 3]
            turned -= T[i, 3] * body[1 + j] + body[1 + i] * T[j, 3]
            body[4 + 3 * i + j] = turned + (square + along if i == j else 0.0)
    for i in range(3):
        body[1 + i] += mass * T[i, 3]


@inner
def _momentum(body: Array, motion: Array, out: Array) -> None:
    """Write the momentum (6,) of a body (13,) with a motion (6,): angular, then linear."""
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        out[i] = body[1 + a] * motion[3 + b] - body[1 + b] * motion[3 + a]
        for j in range(3):
            out[i] += body[4 + 3 * i + j] * motion[j]
        out[3 + i] = body[0] * motion[3 + i] + motion[a] * body[1 + b] - motion[b] * body[1 + a]


@inner
def _efforts(axes: Array, bodies: Array, dq: Array, ddq: Array, row: Array, effort: Array) -> None:
    """Write the efforts (n,) of the bodies alone, without motors."""
    n = dq.shape[0]
    at = n + 7 + 12 * (n + 1)
    motion, rise, held, felt = np.zeros(6), np.zeros(6), np.empty(6), np.empty(6)
    force = np.zeros((n, 6))
    for i in range(3):
        rise[3 + i] = -row[at + i]
    for k in range(n):
        S = axes[k]
        for i in range(6):
            motion[i] += S[i] * dq[k]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            rise[i] += S[i] * ddq[k] + (motion[a] * S[b] - motion[b] * S[a]) * dq[k]
            turned = motion[a] * S[3 + b] - motion[b] * S[3 + a]
            turned += motion[3 + a] * S[b] - motion[3 + b] * S[a]
            rise[3 + i] += S[3 + i] * ddq[k] + turned * dq[k]
        _momentum(bodies[k], rise, felt)
        _momentum(bodies[k], motion, held)
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            force[k, i] = felt[i] + motion[a] * held[b] - motion[b] * held[a]
            force[k, i] += motion[3 + a] * held[3 + b] - motion[3 + b] * held[3 + a]
            force[k, 3 + i] = felt[3 + i] + motion[a] * held[3 + b] - motion[b] * held[3 + a]
    for k in range(n - 1, -1, -1):
        effort[k] = 0.0
        for i in range(6):
            effort[k] += axes[k, i] * force[k, i]
            if k > 0:
                force[k - 1, i] += force[k, i]


@inner
def _inertias(axes: Array, bodies: Array, row: Array, M: Array) -> None:
    """Write the inertia (n, n), motors included; each row of ``bodies`` becomes the sum of all later bodies."""
    n = M.shape[0]
    at, held = row.shape[0] - n, np.empty(6)
    for k in range(n - 1, -1, -1):
        _momentum(bodies[k], axes[k], held)
        for i in range(k + 1):
            M[i, k] = 0.0
            for j in range(6):
                M[i, k] += axes[i, j] * held[j]
            M[k, i] = M[i, k]
        M[k, k] += row[at + k]
        if k > 0:
            for j in range(_BODY):
                bodies[k - 1, j] += bodies[k, j]


@kernel
def inverse_dynamics(q: Array, dq: Array, ddq: Array, row: Array, effort: Array) -> None:
    """Write the efforts (n,) [N·m or N] that cause the given motion of the chain, without friction.

    Args:
        q: Joint positions (n,) [rad or m].
        dq: Joint speeds (n,) [rad/s or m/s].
        ddq: Joint accelerations (n,) [rad/s² or m/s²].
        row: See :func:`chain_row`.
        effort: Resulting efforts; written.
    """
    n = q.shape[0]
    axes, bodies = np.empty((n, 6)), np.empty((n, _BODY))
    _place(q, row, axes, bodies)
    _efforts(axes, bodies, dq, ddq, row, effort)
    for i in range(n):
        effort[i] += row[row.shape[0] - n + i] * ddq[i]


@kernel
def tip_efforts(q: Array, wrench: Array, row: Array, effort: Array) -> None:
    """Write the joint efforts (n,) [N·m or N] that an external wrench on the tip causes.

    Added to the efforts of the drives, they give the effort of :func:`inverse_dynamics`.

    Args:
        q: Joint positions (n,) [rad or m].
        wrench: Force [N], then torque [N·m], at the origin of the tip in the axes of the base (6,).
        row: See :func:`chain_row`.
        effort: Resulting efforts; written.

    Source:
        Craig 2005, section 5.10 (the transposed Jacobian maps forces to efforts).
    """
    n = q.shape[0]
    J = np.empty((6, n))
    dh_kernels.jacobian(q, row, J)
    for i in range(n):
        effort[i] = 0.0
        for j in range(6):
            effort[i] += J[j, i] * wrench[j]


@kernel
def inertia_matrix(q: Array, row: Array, M: Array) -> None:
    """Write the inertia (n, n) [kg·m², kg·m or kg] at joints (n,) [rad or m], motors included."""
    n = q.shape[0]
    axes, bodies = np.empty((n, 6)), np.empty((n, _BODY))
    _place(q, row, axes, bodies)
    _inertias(axes, bodies, row, M)


def pseudo_inertias(q: Array, row: Array) -> Array:
    """Pseudo-inertias (n, 4, 4) of bodies in the base; body i is all links between joint i and the next joint.

    Args:
        q: Joint positions (n,) [rad or m].
        row: See :func:`chain_row`.
    """
    n = q.shape[0]
    bodies, out = np.empty((n, _BODY)), np.empty((n, 4, 4))
    _place_bodies(q, row, bodies)
    tensors = bodies[:, 4:].reshape(n, 3, 3)
    spread = 0.5 * np.trace(tensors, axis1=1, axis2=2)
    out[:, :3, :3] = spread[:, None, None] * np.eye(3) - tensors
    out[:, :3, 3] = out[:, 3, :3] = bodies[:, 1:4]
    out[:, 3, 3] = bodies[:, 0]
    return out


@kernel
def _place_bodies(q: Array, row: Array, bodies: Array) -> None:
    _place(q, row, np.empty((q.shape[0], 6)), bodies)


@kernel
def chain_gravity(q: Array, row: Array, effort: Array) -> None:
    """Write the efforts (n,) [N·m or N] that hold the chain at rest."""
    still = np.zeros(q.shape[0])
    inverse_dynamics(q, still, still, row, effort)


@kernel
def chain_acceleration(q: Array, dq: Array, effort: Array, row: Array, ddq: Array) -> None:
    """Write joint accelerations (n,) [rad/s² or m/s²] under net efforts (n,) [N·m or N].

    Every joint must move some inertia, of links or of its motor; otherwise the accelerations are not finite.

    Args:
        q: Joint positions (n,) [rad or m].
        dq: Joint speeds (n,) [rad/s or m/s].
        effort: Efforts of the drives, minus friction.
        row: See :func:`chain_row`.
        ddq: Resulting accelerations; written.
    """
    n = q.shape[0]
    axes, bodies, M = np.empty((n, 6)), np.empty((n, _BODY)), np.empty((n, n))
    bias, still = np.empty(n), np.zeros(n)
    _place(q, row, axes, bodies)
    _efforts(axes, bodies, dq, still, row, bias)
    _inertias(axes, bodies, row, M)
    rigid_body.invert_positive(M)
    for i in range(n):
        ddq[i] = 0.0
        for j in range(n):
            ddq[i] += M[i, j] * (effort[j] - bias[j])
