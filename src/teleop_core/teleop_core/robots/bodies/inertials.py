"""Inertias of bodies: the inertias of the robot's links if its model contains them, else assumed inertias.

All inertias are pseudo-inertias (4, 4). Those of joined bodies add up. They transform between frames as T P Tᵀ
(:mod:`teleop_core.robots.inertias`).
"""

from collections.abc import Sequence

import numpy as np

from teleop_core.kernels import Array, inverse_motion, product, rotations_from_quaternions, transform
from teleop_core.robots.body import Bodies
from teleop_core.robots.dynamics.chain_dynamics import chain_acceleration, pseudo_inertias
from teleop_core.robots.dynamics.followers import chain_part, follower_acceleration, followers_of
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import Solid

DENSITY = 1000.0
"""Assumed density [kg/m³] of the bodies of a robot without masses of links. It is the density of water, which physics
engines assume too; the mean density of motors and hollow links is of this order."""


def has_own_links(robot: Robot) -> bool:
    """Whether the robot's dynamics contain the inertia and the frame of each link."""
    model = robot.dynamics
    of_chains = (chain_acceleration, follower_acceleration)
    return model is not None and (model.acceleration in of_chains or bool(model.frames))


def inertials_of(robot: Robot, bodies: Bodies) -> dict[int, Array]:
    """Pseudo-inertias (4, 4) of bodies in their own frames, by the index of the body; the base is left out.

    Args:
        robot: The robot.
        bodies: Its bodies.

    Returns:
        For a robot with links of its own (:func:`has_own_links`), the inertias of the links with mass. A link that the
        source lumps into another link has no entry. For every other robot, the inertias of all bodies with solids, as
        uniform bodies of :data:`DENSITY`. Where solids overlap, the mass of each solid counts.
    """
    if not has_own_links(robot):
        assumed = {i: sum(map(_uniform, body.solids)) for i, body in enumerate(bodies.bodies)}
        return {i: np.asarray(P) for i, P in assumed.items() if i > 0 and np.any(P)}
    poses = bodies.poses(robot.home)
    found = {}
    for index, P in zip(*_own(robot, bodies), strict=False):
        if P[3, 3] > 0.0:
            found[index] = moved(inverse_motion(_frame(poses[index])), P)
    return found


def moved(T: Array, P: Array) -> Array:
    """Pseudo-inertia (4, 4) in frame A, from the pseudo-inertia ``P`` in frame B; ``T`` is ``T_A_B`` (4, 4)."""
    return product(product(T, P), np.ascontiguousarray(T.T))


def _own(robot: Robot, bodies: Bodies) -> tuple[Sequence[int], Sequence[Array]]:
    """Bodies by index, and the pseudo-inertias of the first of these bodies, in the base, at home."""
    model, followers = robot.dynamics, followers_of(robot)
    assert model is not None
    if model.frames:
        links = zip(model.frames, model.links, strict=True)
        return bodies.joint_body, [moved(T, link.pseudo) for T, link in links]
    if followers is None:
        return bodies.joint_body, list(pseudo_inertias(robot.home.copy(), model.parameters.copy()))
    row = chain_part(model.parameters, followers)
    return range(1, len(bodies.bodies)), list(pseudo_inertias(followers.of(robot.home), row))


def _uniform(solid: Solid) -> Array:
    """Pseudo-inertia of a uniform solid of :data:`DENSITY`, in the body's frame."""
    sizes, P = solid.size, np.zeros((4, 4))
    if solid.kind == "box":
        parts = [(sizes[0] * sizes[1] * sizes[2], [side**2 / 12.0 for side in sizes])]
    else:
        r, span = sizes[0], sizes[1] if len(sizes) > 1 else 0.0
        rod = (np.pi * r**2 * span, [r**2 / 4.0, r**2 / 4.0, span**2 / 12.0])
        # Each end of the capsule is half a ball; its centre of mass is 3/8 of the radius beyond the end of the
        # cylinder.
        along = r**2 / 5.0 + 0.375 * r * span + 0.25 * span**2
        ball = (4.0 / 3.0 * np.pi * r * r * r, [r**2 / 5.0, r**2 / 5.0, along])
        parts = {"cylinder": [rod], "sphere": [ball], "capsule": [rod, ball]}[solid.kind]
    for volume, squares in parts:
        P += DENSITY * volume * np.diag([*squares, 1.0])
    return moved(_frame(solid.pose), P)


def _frame(pose: Array) -> Array:
    return transform(rotations_from_quaternions(pose[3:]), pose[:3])
