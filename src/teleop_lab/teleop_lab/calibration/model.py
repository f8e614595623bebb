"""Model of a calibration: the tip position of an arm with link errors, and the derivatives of this position.

The derivatives are analytic. An error of theta rotates all later links about the joint's axis, and an error of d
translates them along this axis. An error of alpha rotates them about the link's common normal, and an error of a
translates them along this normal.

Source:
    Mooring, Roth and Driels 1991, Fundamentals of manipulator calibration:
    the identification Jacobian; here as geometric vectors.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots.arms.as_chain import chain_of
from teleop_core.robots.link_errors import Chain, LinkErrors, error_names, next_axis_motion
from teleop_core.robots.robot import Robot

FRAME = ("frame_x", "frame_y", "frame_z", "frame_rx", "frame_ry", "frame_rz")
"""Pose of the arm's base in the frame of the measurement: position [m], rotation vector [rad]."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Pose of the arm's base in the frame of a measurement, before the six errors of the pose are found.

    Args:
        rotation: Rotation matrix of the base (3, 3).
        place: Position of the base (3,) [m].
    """

    rotation: Array
    place: Array

    @staticmethod
    def known() -> "Frame":
        """Return the frame of a measurement in the arm's base."""
        return Frame(np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class ChainModel:
    """Tip of a chain as a function of the vector of unknowns: 4n link errors, then :data:`FRAME`.

    Args:
        robot: The nominal arm.
        chain: The nominal arm as transforms.
        frame: Frame of the measurement.
    """

    robot: Robot
    chain: Chain
    frame: Frame

    @staticmethod
    def of(robot: Robot, frame: Frame | None = None) -> "ChainModel":
        """Return the model of a robot that is a chain.

        Raises:
            ParameterError: The robot is not a chain.
        """
        chain = chain_of(robot)
        if chain is None:
            needed = "a chain of links, such as rcrt1, puma560 or a Denavit-Hartenberg table"
            raise ParameterError("robot", robot.name, needed)
        return ChainModel(robot, chain, frame or Frame.known())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vector's entries: a1 ... an, alpha1 ..., d1 ..., theta1 ..., frame_x ..."""
        return (*error_names(self.chain.n), *FRAME)

    @property
    def offsets(self) -> tuple[str, ...]:
        """Names of the joint offsets, beginning at the base."""
        return tuple(f"{'theta' if abs(kind) < 1.5 else 'd'}{i + 1}" for i, kind in enumerate(self.chain.kinds))

    @property
    def size(self) -> float:
        """Length [m] of the arm. An angle is multiplied by it for comparisons with lengths."""
        return float(self.chain.row[self.chain.n])

    def unit(self, name: str) -> str:
        """Unit of an entry: "rad" or "m"."""
        return "rad" if name.startswith(("alpha", "theta", "frame_r")) else "m"

    def tips(self, q: Array, vector: Array) -> Array:
        """Position of the tip (N, 3) [m], in the frame of the measurement, at joints (N, n)."""
        return self._frames(q, vector)[0]

    def jacobian(self, q: Array, vector: Array) -> Array:
        """Derivatives of :meth:`tips` by the vector (N, 3, 4n + 6); those by the frame's rotation are taken at zero."""
        tip, along, about, alpha_place, theta_place = self._frames(q, vector)
        turns = np.concatenate(
            (np.cross(along, tip[:, None] - alpha_place), np.cross(about, tip[:, None] - theta_place)), axis=1
        )
        n = self.chain.n
        columns = np.concatenate((along, turns[:, :n], about, turns[:, n:]), axis=1)
        eye = np.broadcast_to(np.eye(3), (len(tip), 3, 3))
        lever = tip - self._place(vector)
        spin = np.stack([np.cross(axis, lever) for axis in np.eye(3)], axis=1)
        return np.concatenate((columns, eye, spin), axis=1).transpose(0, 2, 1)

    def _place(self, vector: Array) -> Array:
        return self.frame.place + vector[4 * self.chain.n :][:3]

    def _base(self, vector: Array) -> Array:
        """Base of the arm (4, 4) in the frame of the measurement."""
        turn = rotation_of(vector[4 * self.chain.n + 3 :])
        return transform(turn @ self.frame.rotation, self._place(vector))

    def _frames(self, q: Array, vector: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Positions of the tip (N, 3), directions of normals and joint axes (N, n, 3), and points on these lines."""
        errors = LinkErrors.from_vector(vector[: 4 * self.chain.n])
        T = np.tile(self._base(vector) @ self.chain.fixed[0], (len(q), 1, 1))
        shape = (len(q), self.chain.n, 3)
        along, about, normal_place, axis_place = (np.empty(shape) for _ in range(4))
        for i, kind in enumerate(self.chain.kinds):
            about[:, i], axis_place[:, i] = T[:, :3, 2], T[:, :3, 3]
            T = T @ joint_motions(kind, q[:, i])
            S = next_axis_motion(self.chain.fixed[i + 1])
            z = transform(rotation("z", errors.theta[i]), np.array([0.0, 0.0, errors.d[i]]))
            x = transform(np.eye(3), np.array([errors.a[i], 0.0, 0.0]))
            T = T @ (z @ self.chain.fixed[i + 1] @ np.linalg.inv(S) @ x)
            along[:, i], normal_place[:, i] = T[:, :3, 0], T[:, :3, 3]
            T = T @ (transform(rotation("x", errors.alpha[i]), np.zeros(3)) @ S)
        return T[:, :3, 3], along, about, normal_place, axis_place


def joint_motions(kind: float, q: Array) -> Array:
    """Transforms (N, 4, 4) of a joint at positions (N,); ``kind`` is that of the kernels of chains."""
    out = np.tile(np.eye(4), (len(q), 1, 1))
    if abs(kind) > 1.5:
        out[:, 2, 3] = 0.5 * kind * q
        return out
    c, s = np.cos(q), kind * np.sin(q)
    out[:, 0, 0], out[:, 0, 1], out[:, 1, 0], out[:, 1, 1] = c, -s, s, c
    return out


def rotation_of(vector: Array) -> Array:
    """Rotation (3, 3) of a rotation vector (3,) [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def aligned(points: Array, measured: Array) -> Frame:
    """Frame in which points (N, 3) are closest to their measured positions (N, 3), by least squares.

    Source:
        Kabsch 1976; Umeyama 1991, who keeps the rotation right-handed.
    """
    middle, there = points.mean(axis=0), measured.mean(axis=0)
    U, _, Vt = np.linalg.svd((measured - there).T @ (points - middle))
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = U @ D @ Vt
    return Frame(R, there - R @ middle)
