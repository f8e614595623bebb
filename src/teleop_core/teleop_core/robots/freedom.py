"""Freedom: the distance by which the tip can move in every direction, and the posture at which a slave starts.

The tip is moved away from a posture in small steps, along 26 directions, and rotated about 26 axes, as a hand would
move it. The motion in a direction stops at a joint limit, or near a singularity, where a joint has to move
:data:`SWIFT` times as far as the tool. The *room* of the posture is the distance in the worst direction.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from teleop_core import kinematics
from teleop_core.kernels import Array, length, product, raise_pending, rotations_from_quaternions
from teleop_core.robots import arm

# Angle of one step of rotation [rad]. The length of one step of translation is this angle times reach/pi.
STEP = math.radians(2.0)
STEPS = 45
# Near a singularity a joint moves more than this many times as far as the tool.
SWIFT = 3.0
# Rotation [rad] in the worst direction with which home has enough room.
ENOUGH = math.radians(30.0)
# Translation in the worst direction with which home has enough room, divided by reach/pi: reach/15.
ENOUGH_MOVE = math.radians(12.0)
# Postures with at least this share of the largest room count as equal.
EQUAL = 0.9
# Number of postures that are examined.
SAMPLES = 512
# Number of postures that are walked before it is asked whether one of them has all the room that there can be.
BATCH = 32
_KNOWN: dict[tuple[object, ...], Array] = {}


class Freedom(NamedTuple):
    """How far the tip can move from a posture in the worst of the directions that it controls."""

    metres: float
    """Distance of the tip at constant attitude; inf if no position is controlled."""
    radians: float
    """Rotation about the fixed tip; inf if no rotation is controlled."""


def freedom(robot: arm.Arm, q: object) -> Freedom:
    """How far the tip can go from a posture in every direction.

    Args:
        robot: The arm.
        q: Joint vector (n,) [rad, m] inside the limits.

    Returns:
        :class:`Freedom`, in whole steps. A step of rotation is 2 degrees; a step of translation is 2 degrees [rad]
        times reach/pi. The search stops after 45 steps (90 degrees).

    Raises:
        ShapeError: The shape of ``q`` is not (n,).
        ParameterError: ``q`` contains NaN or infinity.
    """
    postures = np.array(q, dtype=np.float64, ndmin=2)
    moves, turns = _steps(robot, postures)
    return Freedom(float(moves[0]) * STEP * lever(robot), float(turns[0]) * STEP)


def lever(robot: arm.Arm) -> float:
    """Distance [m] that counts as much as a radian: reach/pi.

    The reach is the largest distance between the tip and the origin of the base in the examined postures.
    """
    return float(length(_poses(robot, samples(robot))[:, :3, 3]).max()) / math.pi


def samples(robot: arm.Arm) -> Array:
    """Joint vectors (:data:`SAMPLES`, n) spread evenly inside the limits; every call returns the same ones.

    Source:
        Roberts 2018, the R sequence, built from the powers of the root of x^(n+1) = x + 1.
    """
    root = 2.0
    for _ in range(60):
        root = math.pow(1.0 + root, 1.0 / (robot.n + 1))
    steps = [math.pow(root, -1.0 - i) for i in range(robot.n)]
    shares = np.arange(1, SAMPLES + 1)[:, None] * np.array(steps) + 0.5
    return robot.lower + (shares % 1.0) * (robot.upper - robot.lower)


def start_of(robot: arm.Arm) -> Array:
    """Result of :func:`start_posture`, computed once per program for equal robots."""
    arrays = (robot.lower, robot.upper, robot.home, robot.geometry_row, np.array(robot.task_mask))
    key = (robot.kernels, *(array.tobytes() for array in arrays))
    if key not in _KNOWN:
        _KNOWN[key] = start_posture(robot)
    return _KNOWN[key]


def start_posture(robot: arm.Arm) -> Array:
    """Posture from which the tip has room in all directions, by a deterministic rule.

    Home is taken if it has enough room: a rotation by 30 degrees and a move by reach/15. Otherwise the candidates are
    the examined postures with the tool attitude of home. If none of these can rotate by 30 degrees and move by 30
    degrees times reach/pi, all examined postures are candidates. Of the candidates with at least :data:`EQUAL` of the
    largest room, the one nearest to home is taken. The distance from home is the largest joint difference, divided by
    the range of the joint.

    Args:
        robot: The arm.

    Returns:
        Joint vector (n,) [rad, m], inside the limits; home if no posture has more room.
    """
    move, turn = round(ENOUGH_MOVE / STEP), round(ENOUGH / STEP)
    moves, turns = _steps(robot, robot.home[None], np.array([move]), np.array([turn]))
    if moves[0] >= move and turns[0] >= turn:
        return robot.home
    spread = samples(robot)
    held = _poses(robot, spread)
    held[:, :3, :3] = robot.fk(robot.home)[:3, :3]
    answer = robot.ik_batch(held)
    followed = answer.q[answer.status == kinematics.IkStatus.FOLLOWED]
    postures, steps = _walked(robot, np.vstack((robot.home, followed)))
    if steps.max() < turn:
        others, more = _walked(robot, spread)
        postures, steps = np.vstack((postures, others)), np.concatenate((steps, more))
    good = postures[steps >= EQUAL * steps.max()]
    return np.asarray(good[int(_away(robot, good).argmin())])


def _away(robot: arm.Arm, postures: Array) -> Array:
    """Distance (N,) of postures from home: the largest joint difference, divided by the range of the joint."""
    return np.abs((postures - robot.home) / (robot.upper - robot.lower)).max(axis=1)


def _walked(robot: arm.Arm, postures: Array) -> tuple[Array, Array]:
    """Postures (k, n), the nearest to home first, and their steps (k,).

    Those behind the first one with the largest possible room are left out: they are no better, and farther away.
    """
    postures = postures[np.argsort(_away(robot, postures), kind="stable")]
    parts = list[Array]()
    for begin in range(0, len(postures), BATCH):
        parts.append(_least_steps(robot, postures[begin : begin + BATCH]))
        if parts[-1].max() >= STEPS:
            break
    steps = np.concatenate(parts)
    return postures[: len(steps)], steps


def free_postures(robot: arm.Arm, count: int) -> Array:
    """Postures with room in all directions: the start first, then the examined postures with the most room.

    Args:
        robot: The arm.
        count: Largest number of postures.

    Returns:
        Postures (k, n) [rad, m] with k >= 1; postures without room are left out.
    """
    spread = samples(robot)
    steps = _least_steps(robot, spread)
    order = np.argsort(-steps, kind="stable")
    wide = spread[order[steps[order] > 0.0]]
    return np.vstack((robot.start, wide[: count - 1]))


def _poses(robot: arm.Arm, postures: Array) -> Array:
    """Poses (N, 4, 4) in the assembly of home; poses of least error for joints at which the loops do not close."""
    return robot.solve_fk_batch(postures, search=False).T


def _steps(
    robot: arm.Arm, postures: Array, move: Array | None = None, turn: Array | None = None
) -> tuple[Array, Array]:
    """Steps (N,) of translation, and of rotation, that postures allow in the worst direction; inf without direction.

    ``move`` and ``turn`` (N,) are numbers of steps at which the walk of a posture may end.
    """
    mask = np.array(robot.task_mask)
    return (
        _walk(robot, postures, _directions(mask[:3]), move, is_turn=False),
        _walk(robot, postures, _directions(mask[3:]), turn, is_turn=True),
    )


def _least_steps(robot: arm.Arm, postures: Array) -> Array:
    """Steps (N,) that postures allow in translation and in rotation; no more rotations are tried than translations."""
    mask = np.array(robot.task_mask)
    moves = _walk(robot, postures, _directions(mask[:3]), is_turn=False)
    return np.minimum(moves, _walk(robot, postures, _directions(mask[3:]), moves, is_turn=True))


def _directions(controlled: NDArray[np.bool_]) -> Array:
    """Unit vectors (k, 3) along the controlled axes, in both directions, and along all diagonals between these axes."""
    every = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
    kept = every[(every != 0.0).any(axis=1) & (every[:, ~controlled] == 0.0).all(axis=1)]
    return kept / length(kept)[:, None]


def _walk(robot: arm.Arm, postures: Array, directions: Array, enough: Array | None = None, *, is_turn: bool) -> Array:
    """Number of steps (N,) that each posture allows in its worst direction; the walk ends after ``enough`` (N,)."""
    count, fan = len(postures), len(directions)
    if not fan:
        return np.full(count, np.inf)
    most = np.full(count, STEPS) if enough is None else np.minimum(enough, STEPS)
    slide = STEP * lever(robot)
    limits, unit = robot.limits(), STEP if is_turn else slide
    jacobian = np.empty((6, robot.n))
    robot.kernels.jacobian(robot.home.copy(), robot.geometry_row, jacobian)
    is_sliding = np.abs(jacobian[3:]).max(axis=0) < 1e-9
    limits[2] = SWIFT * np.where(is_sliding, slide, STEP)
    begin, steps = _poses(robot, postures), np.zeros(count)
    alive, seeds = np.arange(count), np.repeat(postures[:, None], fan, axis=1)
    for step in range(1, STEPS + 1):
        goes_on = most[alive] >= step
        alive, seeds = alive[goes_on], seeds[goes_on]
        if not len(alive):
            break
        poses = _moved(begin[alive], step * unit * directions, is_turn)
        seeds, is_there = _solve(robot, poses, seeds, limits)
        alive, seeds = alive[is_there], seeds[is_there]
        steps[alive] = step
    return steps


def _moved(begin: Array, offsets: Array, is_turn: bool) -> Array:
    """Poses (N, k, 4, 4): each of the N poses, shifted [m] or rotated [rad] by each of the k offsets (k, 3)."""
    poses = np.repeat(begin, len(offsets), axis=0).reshape(len(begin), -1, 4, 4)
    if is_turn:
        angle = length(offsets)[:, None]
        quaternions = np.hstack((np.cos(angle / 2), offsets / angle * np.sin(angle / 2)))
        poses[..., :3, :3] = product(rotations_from_quaternions(quaternions), poses[..., :3, :3])
    else:
        poses[..., :3, 3] += offsets
    return poses


def _solve(robot: arm.Arm, poses: Array, seeds: Array, limits: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Joints (N, k, n) of poses (N, k, 4, 4), and whether all k poses of a posture are reached (N,)."""
    q, is_there = np.empty_like(seeds), np.zeros(len(seeds), np.bool_)
    kinematics.ik_fans(robot.ik_pointer, poses, seeds, limits, robot.geometry_row, q, is_there)
    raise_pending()
    return q, is_there
