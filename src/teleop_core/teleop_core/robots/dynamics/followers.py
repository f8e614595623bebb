"""Followers: chains in which one joint moves several motions, each by a factor and an offset.

This is the ``mimic`` of a URDF. The motions p (m,) of the chain follow the joints q (n,): p = A q + b, where each row
of A contains one factor. With the Jacobian J and the inertia M of the motions, the Jacobian of the joints is J A and
their inertia is Aᵀ M A. By the principle of virtual work, the efforts of the joints are Aᵀ times those of the motions.
A is constant, so there is no term with its derivative.

The parameter row of the dynamics contains in this order: m; the leaders (m,), factors (m,) and offsets (m,) of the
motions; the inertias (n,) of the motors at the joints; the row of :mod:`~teleop_core.robots.dynamics.chain_dynamics` of
the m motions, with motor inertias of zero.

Source:
    Featherstone 2008, section 3.2 (implicit and explicit constraints) and equation 3.21.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import dh_kernels
from teleop_core.robots.drives import Dynamics
from teleop_core.robots.dynamics import chain_dynamics, rigid_body
from teleop_core.robots.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Follower:
    """A motion of a chain: ``factor`` times the joint of index ``leader``, plus ``offset``."""

    leader: int
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Followers:
    """How the motions of a chain follow its joints, and the kind of each joint: 1 turns, 2 slides."""

    motions: tuple[Follower, ...]
    kinds: tuple[float, ...]

    @property
    def row(self) -> list[float]:
        """Leaders (m,), factors (m,), then offsets (m,), as the kernels read them."""
        columns = zip(*((f.leader, f.factor, f.offset) for f in self.motions), strict=True)
        return [float(value) for column in columns for value in column]

    @property
    def is_plain(self) -> bool:
        """Whether motion i is joint i for all i, as in a chain without followers."""
        return self.motions == tuple(Follower(leader=i) for i in range(len(self.kinds)))

    @property
    def first(self) -> list[int]:
        """For each joint, the index of the first motion that it moves."""
        leaders = [f.leader for f in self.motions]
        return [leaders.index(joint) for joint in range(len(self.kinds))]

    @property
    def coordinates(self) -> list[int]:
        """Index of each motion (m,) in the list of joints, then motions; a motion that is a joint gets its index."""
        n, same = len(self.kinds), [f == Follower(leader=f.leader) for f in self.motions]
        return [f.leader if same[i] else n + i for i, f in enumerate(self.motions)]

    def of(self, q: Array) -> Array:
        """Motions (..., m) of joint vectors (..., n) [rad, m]."""
        return np.stack([f.factor * q[..., f.leader] + f.offset for f in self.motions], axis=-1)

    def chain_jacobian(self, geometry: Array, motions: Array) -> Array:
        """Geometric Jacobian (6, m) of the motions, from the geometry row of the robot."""
        out = np.empty((6, len(self.motions)))
        dh_kernels.jacobian(motions, geometry[len(self.kinds) + 8 + 3 * len(self.motions) :].copy(), out)
        return out


def followers_of(robot: Robot) -> Followers | None:
    """How the motions of a robot follow its joints; None for a robot without followers."""
    if "motions" not in robot.geometry:
        return None
    n, m, row = robot.n, int(robot.geometry["motions"]) - 1, robot.geometry_row
    columns = row[n + 8 : n + 8 + 3 * m].reshape(3, m).T.tolist()
    motions = (Follower(leader=int(j), factor=f, offset=b) for j, f, b in columns)
    return Followers(motions=tuple(motions), kinds=tuple(row[:n].tolist()))


def dynamics_row(followers: Followers, chain: Array, motors: Array) -> Array:
    """Parameter row of the kernels below.

    Args:
        followers: Relation of the chain's motions to the joints.
        chain: Row of :func:`~teleop_core.robots.dynamics.chain_dynamics.chain_row` of the motions.
        motors: Inertia of each motor at its joint (n,) [kg·m² or kg].
    """
    return np.concatenate([[float(len(followers.motions))], followers.row, motors, chain])


def chain_part(row: Array, followers: Followers) -> Array:
    """Copy of the row of the motions within a row of :func:`dynamics_row`; the caller may change it."""
    return row[1 + 3 * len(followers.motions) + len(followers.kinds) :].copy()


def follower_dynamics(row: Array, joints: int) -> Dynamics:
    """Model of ``joints`` joints with a row of :func:`dynamics_row`; the controller feeds all gravity forward."""
    return Dynamics(
        acceleration=follower_acceleration,
        gravity=follower_gravity,
        parameters=row,
        compensated=np.ones(joints, np.bool_),
    )


@inner
def _efforts(q: Array, dq: Array, row: Array, effort: Array) -> None:
    """Write the efforts (n,) of the joints at these positions and speeds, without acceleration."""
    n, m = q.shape[0], int(row[0])
    p, dp, still, felt = np.empty(m), np.empty(m), np.zeros(m), np.empty(m)
    dh_kernels.spread(q, row[1:], p)
    for i in range(m):
        dp[i] = row[1 + m + i] * dq[int(row[1 + i])]
    chain_dynamics.inverse_dynamics(p, dp, still, row[1 + 3 * m + n :], felt)
    for j in range(n):
        effort[j] = 0.0
    for i in range(m):
        effort[int(row[1 + i])] += row[1 + m + i] * felt[i]


@kernel
def follower_inertia(q: Array, row: Array, M: Array) -> None:
    """Write the inertia (n, n) [kg·m², kg·m or kg] at joints (n,) [rad or m], motors included."""
    n, m = q.shape[0], int(row[0])
    p, whole = np.empty(m), np.empty((m, m))
    dh_kernels.spread(q, row[1:], p)
    chain_dynamics.inertia_matrix(p, row[1 + 3 * m + n :], whole)
    for j in range(n):
        for k in range(n):
            M[j, k] = row[1 + 3 * m + j] if j == k else 0.0
    for i in range(m):
        for k in range(m):
            factors = row[1 + m + i] * row[1 + m + k]
            M[int(row[1 + i]), int(row[1 + k])] += factors * whole[i, k]


@kernel
def follower_gravity(q: Array, row: Array, effort: Array) -> None:
    """Write the efforts (n,) [N·m or N] that hold the chain at rest."""
    _efforts(q, np.zeros(q.shape[0]), row, effort)


@kernel
def follower_acceleration(q: Array, dq: Array, effort: Array, row: Array, ddq: Array) -> None:
    """Write joint accelerations (n,) [rad/s² or m/s²] under net efforts (n,) [N·m or N]."""
    n = q.shape[0]
    M, bias = np.empty((n, n)), np.empty(n)
    _efforts(q, dq, row, bias)
    follower_inertia(q, row, M)
    rigid_body.invert_positive(M)
    for i in range(n):
        ddq[i] = 0.0
        for j in range(n):
            ddq[i] += M[i, j] * (effort[j] - bias[j])
