"""Inverse kinematics of the MMA: seven joints for six degrees of freedom, on the branch nearest to the seed.

The local search resolves the redundancy by damped least squares inside the joint limits: it finds the smallest joint
move that brings the tool to the pose. The search in the closed-form family then finds nearer branches, and solutions
that a local search misses.

Source:
    The thesis contains no inverse kinematics. Least squares on (position / 100 mm, rotation vector) are those of the
    notes that check Singh 2014. The search over branches is ours.
"""

import math

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.kinematics import IkStatus, damped, is_askable, pose_residual
from teleop_core.kinematics.branches import bounded
from teleop_machines import mma_branches, mma_forward

LENGTH = 0.1  # distance [m] that weighs as much as one radian
_ROUNDS = 60  # largest number of rounds of the local search
_PATH_ROUNDS = 12  # largest number of rounds of the local search in a path
_STALLED = 1e-5  # the local search stops if a round reduces the squared error by a smaller share
_DAMPING = 1e-2  # initial damping, divided by the squared error
_LEAST_DAMPING = 1e-6  # least damping, divided by the squared error
_HOPELESS = 1e10  # the local search stops when the damping, divided by the squared error, exceeds this value
_KICK = 0.02  # joint move by which the search leaves a singular pose [rad]
_STEP = math.radians(5.0)  # step of θ10 in the search of the branches
_NEAR = 0.02  # with a smaller singular value, one radian of the tool needs more than 50 rad of the joints
_FOLLOWED, _LIMITED = int(IkStatus.FOLLOWED), int(IkStatus.LIMITED)
_NEAR_SINGULAR, _UNREACHABLE = int(IkStatus.NEAR_SINGULAR), int(IkStatus.UNREACHABLE)


@inner
def _descend(T: Array, box: Array, geometry: Array, rounds: int, q: Array) -> float:
    """Reduce the pose error from ``q`` (7,), inside a box, until it is zero or minimal.

    Args:
        T: Wanted ``T_base_tip`` (4, 4).
        box: Lower and upper joint positions; later rows are ignored (2 or more, 7).
        geometry: Row of the robot.
        rounds: Largest number of evaluations.
        q: Start inside the box (7,), then the result.

    Returns:
        Squared weighted error that is left.
    """
    J, reached, is_free = np.empty((6, 7)), np.empty((4, 4)), np.empty(7)
    error, left, trial = np.empty(6), np.empty(6), np.empty(7)
    damped.assign(trial, q)
    square, damping = math.inf, _DAMPING
    for _ in range(rounds):
        mma_forward.fk(trial, geometry, reached)
        trial_square = damped.pose_error(reached, T, LENGTH, left)
        if trial_square < square:
            is_stalled = trial_square > (1.0 - _STALLED) * square
            square, damping = trial_square, max(0.2 * damping, _LEAST_DAMPING)
            damped.assign(error, left)
            damped.assign(q, trial)
            if square <= damped.ZERO or is_stalled:
                break
            mma_forward.jacobian_at(q, geometry, reached, J)
            damped.weigh(J, LENGTH)
            if damped.free_joints(J, error, q, box, is_free) <= 1e-9 * math.sqrt(square):
                break
        else:
            damping *= 10.0
            if damping > _HOPELESS:
                break
        damped.damped_move(J, error, damping * square, is_free, box, q, trial)
    return float(square)


@inner
def _approach(T: Array, box: Array, geometry: Array, rounds: int, q: Array) -> float:
    """Move ``q`` (7,) inside a box to the pose T, or to the local minimum of the error.

    At a singular pose the error may be in the direction in which the arm cannot move, so that no small step reduces it.
    Then all joints are moved a little; this move is kept only if the error decreases.

    Returns:
        Squared weighted error that is left.
    """
    trial, square = np.empty(7), math.inf
    for kick in (0.0, _KICK):
        for i in range(7):
            move = kick if i % 2 == 0 else -kick
            trial[i] = min(max(q[i] + move, box[0, i]), box[1, i])
        left = _descend(T, box, geometry, rounds, trial)
        if left < 0.99 * square:
            square = left
            damped.assign(q, trial)
        if square <= damped.ZERO:
            break
    return float(square)


@inner
def _cost(T: Array, turn: float, choice: int, seed: Array, limits: Array, geometry: Array, q: Array) -> float:
    """Write one branch; return its largest joint move, or infinity if it misses the pose or violates a limit."""
    if mma_branches.branch(T, turn, choice, geometry, seed, q) > 0.0:
        return math.inf
    return float(mma_branches.unwrapped(q, seed, limits))


@kernel
def _scan(T: Array, seed: Array, limits: Array, geometry: Array, bound: float, found: Array) -> float:
    """Search for branches nearer to the seed than ``bound``, in steps of θ10 away from the seed.

    The largest joint move is at least the move of θ10. The search therefore ends when the move of θ10 alone is as large
    as the best result so far.

    Returns:
        Largest joint move of the branch that is written as (θ10, choice) to ``found``; ``bound`` if there is none.
    """
    best = bound
    for k in range(73):
        turn = _STEP * ((k + 1) // 2) * (1.0 if k % 2 == 0 else -1.0)
        if abs(turn) >= best:
            break
        best = mma_branches.nearest_branch(T, seed[6] + turn, seed, limits, geometry, best, found)
    return float(best)


@inner
def _refine(T: Array, seed: Array, limits: Array, geometry: Array, found: Array, q: Array) -> float:
    """Find the θ10 within one step whose largest joint move is smallest, and write the joints for it."""
    choice, turn, width = int(found[1]), found[0], 0.5 * _STEP
    trial = np.empty(7)
    best = _cost(T, turn, choice, seed, limits, geometry, q)
    while width > 1e-4:
        centre = turn
        for side in range(2):
            place = centre + (width if side == 0 else -width)
            cost = _cost(T, place, choice, seed, limits, geometry, trial)
            if cost < best:
                best, turn = cost, place
                damped.assign(q, trial)
        width *= 0.5
    return float(best)


@inner
def _nearest_miss(T: Array, seed: Array, geometry: Array, q: Array) -> float:
    """Write the branch with the smallest remaining wrist distance over a full turn of θ10; return that distance [m]."""
    found, least, width = np.empty(2), math.inf, 2.0 * _STEP
    found[0], found[1] = seed[6], 0.0
    for k in range(36):
        least = mma_branches.least_miss(T, seed[6] + width * k, seed, geometry, least, found)
        if least == 0.0:
            break
    while least > 0.0 and width > 1e-3:
        width *= 0.5
        centre = found[0]
        least = mma_branches.least_miss(T, centre + width, seed, geometry, least, found)
        least = mma_branches.least_miss(T, centre - width, seed, geometry, least, found)
    mma_branches.branch(T, found[0], int(found[1]), geometry, seed, q)
    return float(least)


@inner
def _can_reach(T: Array, q: Array, geometry: Array) -> bool:
    """Whether any joint vector reaches a pose, ignoring limits; the search begins at θ10 of ``q``."""
    H, S, F, G = mma_forward.groups(geometry)
    arm = math.hypot(geometry[1] + geometry[2] + H, geometry[4]) + math.hypot(F, S + G)
    square = T[0, 3] * T[0, 3] + T[1, 3] * T[1, 3] + (T[2, 3] - geometry[0]) ** 2
    if square > arm * arm:
        return False
    return bool(_nearest_miss(T, q, geometry, np.empty(7)) == 0.0)


@inner
def _search_branches(T: Array, seed: Array, limits: Array, geometry: Array, left: float, q: Array) -> None:
    """Replace ``q`` by joints that reach the pose and are nearer to the seed, if such joints exist.

    Args:
        T: Wanted ``T_base_tip`` (4, 4).
        seed: Joints (7,) to stay next to.
        limits: Rows lower, upper and more (3, 7).
        geometry: Row of the robot.
        left: Squared weighted error of ``q``; if it is not zero, any solution is better.
        q: Result (7,) of the local search; overwritten with the result of this search.
    """
    found, trial, bound = np.empty(2), np.empty(7), math.inf
    if left <= damped.ZERO:
        bound = mma_branches.unwrapped(q, seed, limits)
    if _scan(T, seed, limits, geometry, bound, found) < bound:
        _refine(T, seed, limits, geometry, found, q)
    elif left > damped.ZERO:
        _nearest_miss(T, seed, geometry, trial)
        mma_branches.unwrapped(trial, seed, limits)
        if _approach(T, limits, geometry, _ROUNDS, trial) < left:
            damped.assign(q, trial)


@kernel
def ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> int:
    """Write joints (7,) for ``T_base_tip``; see :class:`teleop_core.robots.robot.Kernels`.

    Along a path (finite steps) only the local search is used, within one step around the seed. The branch cannot
    change, and at a singularity the arm lags behind and continues.
    """
    if not is_askable(T, seed):
        return -1
    is_path = math.isfinite(limits[2, 0])
    box, J, reached = np.empty((2, 7)), np.empty((6, 7)), np.empty((4, 4))
    for i in range(7):
        box[0, i] = bounded(-math.inf, seed[i], limits[0, i], limits[1, i], limits[2, i])
        box[1, i] = bounded(math.inf, seed[i], limits[0, i], limits[1, i], limits[2, i])
    damped.assign(q, seed)
    left = _approach(T, box, geometry, _PATH_ROUNDS if is_path else _ROUNDS, q)
    if not is_path:
        _search_branches(T, seed, limits, geometry, left, q)
    mma_forward.fk(q, geometry, reached)
    if not pose_residual(reached, T, residual):
        return _LIMITED if _can_reach(T, q, geometry) else _UNREACHABLE
    mma_forward.jacobian_at(q, geometry, reached, J)
    return _NEAR_SINGULAR if damped.is_near_singular(J, LENGTH, _NEAR) else _FOLLOWED


@kernel
def ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    """Write one joint vector per branch (up to 8, 7), with θ10 as near to zero as possible.

    The arm has one joint more than a pose needs, so each branch is a curve of joint vectors; :func:`branch` gives the
    other vectors. Angles are within half a turn of home.
    """
    count, home, free = 0, np.zeros(7), np.empty((2, 7))
    home[1], home[3], home[4] = -0.5 * math.pi, 0.5 * math.pi, 0.5 * math.pi
    for i in range(7):
        free[0, i], free[1, i] = -math.inf, math.inf
    for choice in range(mma_branches.BRANCHES):
        for k in range(73):
            turn = _STEP * ((k + 1) // 2) * (1.0 if k % 2 == 0 else -1.0)
            if mma_branches.branch(T, turn, choice, geometry, home, solutions[count]) == 0.0:
                mma_branches.unwrapped(solutions[count], home, free)
                count += 1
                break
    return count
