"""Inverse kinematics of the MMA: seven joints for six directions, on the branch next to the seed.

Locally the redundancy is resolved by damped least squares inside the joint limits: of all joint
moves that bring the tool to the pose, the smallest. The closed-form family then finds branches
that lie nearer, and the poses that a local search misses.

Source:
    The thesis gives none; least squares on (position / 100 mm, rotation vector) as in the notes
    that check Singh 2014. The search over branches is ours.
"""

import math

import numpy as np

from teleop_core.compiled import kernel
from teleop_core.geometry import Array
from teleop_core.robots.branches import bounded
from teleop_core.robots.damped import (
    ZERO,
    damped_move,
    free_joints,
    pose_error,
    smallest_singular_value,
)
from teleop_core.robots.mma_branches import BRANCHES, branch, least_miss, nearest_branch, unwrapped
from teleop_core.robots.mma_forward import fk, groups, jacobian
from teleop_core.robots.robot import IkStatus, is_askable, pose_residual

LENGTH = 0.1  # distance [m] that weighs as much as one radian
_ROUNDS, _PATH_ROUNDS = 60, 10  # of the local search
_STALLED = 1e-5  # share of the squared error that a round must take off
# Damping per squared error at the start, and the value above which no step helps any more.
_DAMPING, _HOPELESS = 1e-2, 1e10
_KICK = 0.02  # joint move that leaves a singular stand-still [rad]
_STEP = math.radians(5.0)  # of θ10 between two looks at the branches
_NEAR = 0.02  # singular value under which one radian of tool takes more than 50 of joints
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@kernel
def _descend(T: Array, box: Array, geometry: Array, rounds: int, q: Array) -> float:
    """Lower the pose error from ``q`` (7,), inside a box (2, 7), until it is zero or least.

    Returns:
        Squared weighted error that is left.
    """
    J, reached, error = np.empty((6, 7)), np.empty((4, 4)), np.empty(6)
    left, is_free, trial = np.empty(6), np.empty(7), np.empty(7)
    fk(q, geometry, reached)
    square, damping, is_new = pose_error(reached, T, LENGTH, error), _DAMPING, True
    for _ in range(rounds):
        if square <= ZERO or damping > _HOPELESS:
            break
        if is_new:
            jacobian(q, geometry, J)
            J[:3] /= LENGTH
            if free_joints(J, error, q, box, is_free) <= 1e-9 * math.sqrt(square):
                break
        damped_move(J, error, damping * square, is_free, box, q, trial)
        fk(trial, geometry, reached)
        trial_square = pose_error(reached, T, LENGTH, left)
        is_new = trial_square < square
        damping = max(0.2 * damping, 1e-6) if is_new else 10.0 * damping
        if is_new:
            is_stalled = trial_square > (1.0 - _STALLED) * square
            square, error[:], q[:] = trial_square, left, trial
            if is_stalled:
                break
    return float(square)


@kernel
def _approach(T: Array, box: Array, geometry: Array, rounds: int, q: Array) -> float:
    """Move ``q`` (7,) inside a box (2, 7) to the pose T, or as near as a neighbourhood allows.

    Where the error points along a direction that the arm has just lost, no step lowers it at
    first order; a small move of all joints then leaves the stand-still, and is kept only if the
    error becomes less.

    Returns:
        Squared weighted error that is left.
    """
    trial = np.empty(7)
    for i in range(7):
        q[i] = min(max(q[i], box[0, i]), box[1, i])
    square = _descend(T, box, geometry, rounds, q)
    if square <= ZERO:
        return float(square)
    for i in range(7):
        move = _KICK if i % 2 == 0 else -_KICK
        trial[i] = min(max(q[i] + move, box[0, i]), box[1, i])
    left = _descend(T, box, geometry, rounds, trial)
    if left < 0.99 * square:
        q[:], square = trial, left
    return float(square)


@kernel
def _cost(
    T: Array, turn: float, choice: int, seed: Array, limits: Array, geometry: Array, q: Array
) -> float:
    """Write one branch; its largest joint move, infinity when it does not reach or is outside."""
    if branch(T, turn, choice, geometry, seed, q) > 0.0:
        return math.inf
    return float(unwrapped(q, seed, limits))


@kernel
def _scan(
    T: Array, seed: Array, limits: Array, geometry: Array, bound: float, found: Array
) -> float:
    """Look for branches nearer to the seed than ``bound``, in steps of θ10 away from it.

    No joint moves less than θ10, so the search ends where θ10 alone has moved by the best so far.

    Returns:
        Largest joint move of the branch written as (θ10, choice) to ``found``; else ``bound``.
    """
    best = bound
    for k in range(73):
        turn = _STEP * ((k + 1) // 2) * (1.0 if k % 2 == 0 else -1.0)
        if abs(turn) >= best:
            break
        best = nearest_branch(T, seed[6] + turn, seed, limits, geometry, best, found)
    return float(best)


@kernel
def _refine(T: Array, seed: Array, limits: Array, geometry: Array, found: Array, q: Array) -> float:
    """Write the joints at the θ10 within one step where the largest joint move is least."""
    choice, turn, width = int(found[1]), found[0], 0.5 * _STEP
    trial = np.empty(7)
    best = _cost(T, turn, choice, seed, limits, geometry, q)
    while width > 1e-4:
        centre = turn
        for side in range(2):
            place = centre + (width if side == 0 else -width)
            cost = _cost(T, place, choice, seed, limits, geometry, trial)
            if cost < best:
                best, turn, q[:] = cost, place, trial
        width *= 0.5
    return float(best)


@kernel
def _nearest_miss(T: Array, seed: Array, geometry: Array, q: Array) -> float:
    """Write the branch whose wrist stays away least over a full turn of θ10; that distance [m]."""
    found, least, width = np.array((seed[6], 0.0)), math.inf, 2.0 * _STEP
    for k in range(36):
        least = least_miss(T, seed[6] + width * k, seed, geometry, least, found)
        if least == 0.0:
            break
    while least > 0.0 and width > 1e-3:
        width *= 0.5
        centre = found[0]
        least = least_miss(T, centre + width, seed, geometry, least, found)
        least = least_miss(T, centre - width, seed, geometry, least, found)
    branch(T, found[0], int(found[1]), geometry, seed, q)
    return float(least)


@kernel
def _can_reach(T: Array, q: Array, geometry: Array) -> bool:
    """Whether any joint vector reaches a pose, limits or not, searched from θ10 of ``q``."""
    H, S, F, G = groups(geometry)
    arm = math.hypot(geometry[1] + geometry[2] + H, geometry[4]) + math.hypot(F, S + G)
    square = T[0, 3] * T[0, 3] + T[1, 3] * T[1, 3] + (T[2, 3] - geometry[0]) ** 2
    if square > arm * arm:
        return False
    return bool(_nearest_miss(T, q, geometry, np.empty(7)) == 0.0)


@kernel
def _search(T: Array, seed: Array, limits: Array, geometry: Array, q: Array) -> float:
    """Write the reaching joints nearest to the seed, by local search and over all branches.

    Returns:
        Squared weighted error that is left.
    """
    found, trial, bound = np.empty(2), np.empty(7), math.inf
    q[:] = seed
    left = _approach(T, limits[:2], geometry, _ROUNDS, q)
    if left <= ZERO:
        bound = unwrapped(q, seed, limits)
    if _scan(T, seed, limits, geometry, bound, found) < bound:
        _refine(T, seed, limits, geometry, found, q)
        return 0.0
    if left > ZERO:
        _nearest_miss(T, seed, geometry, trial)
        unwrapped(trial, seed, limits)
        other = _approach(T, limits[:2], geometry, _ROUNDS, trial)
        if other < left:
            left, q[:] = other, trial
    return float(left)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (7,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    Along a path (finite steps) only the local search is used, inside one step around the seed:
    the branch cannot change, and at a singularity the arm lags and goes on.
    """
    if not is_askable(T, seed):
        return -1
    box, J = np.empty((2, 7)), np.empty((6, 7))
    if math.isfinite(limits[2, 0]):
        for i in range(7):
            step = limits[2, i]
            box[0, i] = bounded(-math.inf, seed[i], limits[0, i], limits[1, i], step)
            box[1, i] = bounded(math.inf, seed[i], limits[0, i], limits[1, i], step)
        q[:] = seed
        _approach(T, box, geometry, _PATH_ROUNDS, q)
    else:
        _search(T, seed, limits, geometry, q)
    reached = np.empty((4, 4))
    fk(q, geometry, reached)
    if not pose_residual(reached, T, residual):
        return _LIMITED if _can_reach(T, q, geometry) else _UNREACHABLE
    jacobian(q, geometry, J)
    near = smallest_singular_value(J, LENGTH) < _NEAR
    return _NEAR_SINGULAR if near else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write one joint vector per branch (up to 8, 7), with θ10 as near to zero as it can be.

    The arm has one joint more than a pose needs, so each branch stands for a curve of joint
    vectors; :func:`branch` gives the others. Angles lie within half a turn of home.
    """
    count, q = 0, np.empty(7)
    home = np.array((0.0, -0.5 * math.pi, 0.0, 0.5 * math.pi, 0.5 * math.pi, 0.0, 0.0))
    free = np.empty((2, 7))
    free[0], free[1] = -math.inf, math.inf
    for choice in range(BRANCHES):
        for k in range(73):
            turn = _STEP * ((k + 1) // 2) * (1.0 if k % 2 == 0 else -1.0)
            if branch(T, turn, choice, geometry, home, q) == 0.0:
                unwrapped(q, home, free)
                solutions[count] = q
                count += 1
                break
    return count
