"""Search: the placement, turn and gains with which a slave follows a hand's motion.

The search first finds the largest rotation gain that can reach the goal, then the largest gain of translation. If the
motion drifts against a limit, the search shifts the start by the motion that was cut off. This motion is the distance
of the start from the centre of the free range.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from teleop_core.kernels.geometry import Array, multiply_quaternions, transform_from_pose
from teleop_core.kinematics import IkStatus
from teleop_core.robots.freedom import free_postures
from teleop_lab.planning import turns, walk
from teleop_lab.planning.aim import Aim
from teleop_lab.planning.placement import Placement

ROTATION_GAINS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.0)
"""Rotation gains that are tried, the largest first."""
LEAST_GAIN = 0.1
"""Smallest share of the given gain that is tried before the rotation gain is lowered."""
STARTS = 24
"""Number of postures that are tried as starts."""
CUT = 0.03
"""Largest excess of the followed share of a session over the followed share of the original path; a larger excess does
not count. Without this bound, limits that cut most of the motion would make a placement look good."""
# A different start or different axes must increase the gain by this factor, because the operator must get used to
# them.
_WORTH = 1.25
_IMPROVED = 3  # number of the best tried placements that are kept
_ROUNDS = 3  # largest number of shifts of a start
_BISECTIONS = 6
_MOMENTS = (0.25, 0.5, 0.75, 1.0)
_DIGITS = 4
Found = tuple[float, Placement]
"""Share of the time in which the slave follows, and the placement."""


class Search:
    """Search for a placement.

    Args:
        walker: Walks the path, or an excerpt of it.
        given: First placement; its gains are the largest that are tried.
        aim: Fits the tool's axes to every start and turn.
        tell: Called before every walk.
        keeps_axes: Whether ``axes`` must not change.
    """

    def __init__(
        self, walker: walk.Walker, given: Placement, aim: Aim, tell: Callable[[], None], *, keeps_axes: bool = False
    ) -> None:
        self._turns = () if keeps_axes else turns.turns()
        self._walker, self._given, self._aim, self._tell = walker, given, aim, tell
        self._goal = 1.0
        self._known: dict[Placement, float] = {}
        self._starts = [self._rounded(q) for q in free_postures(walker.robot, STARTS)]

    def best(self, goal: float) -> Found:
        """Return the placement with the largest gains that reaches the goal, or else the placement nearest to the goal.

        Args:
            goal: Wanted share of the time in which the slave follows.

        Returns:
            Share of the time in which the slave follows the walker's path, and the placement.
        """
        self._goal, nearest = goal, (-1.0, self._given)
        self._known.clear()
        for rotation_gain in self._rotation_gains():
            found = self._at_rest(rotation_gain)
            nearest = max(nearest, found[0], key=_share)
            if found[0][0] >= self._goal:
                raised = self._with_other(self._raised(found), self._other_starts)
                return self._with_other(raised, self._other_turns)
        return nearest

    def _rotation_gains(self) -> list[float]:
        given = self._given.rotation_gain
        return [given, *(gain for gain in ROTATION_GAINS if gain < given)]

    def _at_rest(self, rotation_gain: float) -> list[Found]:
        """Return the best placements with the least gain, best first.

        The given start and axes are tried first. If they do not reach the goal, other starts are tried, then other
        axes.
        """
        scaled = self._scaled(self._given, LEAST_GAIN, self._given)
        least = replace(scaled, rotation_gain=rotation_gain)
        tried = [self._improved(self._found(least))]
        for others in (self._other_starts, self._other_turns):
            if tried[0][0] >= self._goal:
                break
            more = self._sorted(others(tried[0][1]))[:_IMPROVED]
            tried = sorted((*tried, *map(self._improved, more)), key=_share, reverse=True)
        return tried

    def _other_starts(self, placement: Placement) -> list[Placement]:
        return [replace(placement, start=start) for start in self._starts]

    def _other_turns(self, placement: Placement) -> list[Placement]:
        """Return copies of the placement, one for each allowed map of axes."""
        return [replace(placement, axes=axes) for axes in self._turns]

    def _raised(self, found: Sequence[Found]) -> Found:
        """The largest gain that reaches the goal, searched from placements that reach it with the least gain."""
        low, high, best = math.log(LEAST_GAIN), 0.0, found[0]
        pool = list(found)
        for i in range(_BISECTIONS + 1):
            middle = high if i == 0 else 0.5 * (low + high)  # the given gains first
            tried = self._sorted(self._scaled(self._given, math.exp(middle), placement) for _, placement in pool)
            reached = self._first(tried)
            if reached is None:
                high = middle
                continue
            low, best = middle, reached
            pool = [reached, *pool[:2]]
            if middle == high:
                break
        return best

    def _with_other(self, best: Found, others: Callable[[Placement], Iterable[Placement]]) -> Found:
        """Return one of the other placements if its gain exceeds that of `best` by the factor `_WORTH`, else `best`."""
        while (factor := _WORTH * self._factor(best[1])) <= 1.0:
            raised = self._scaled(self._given, factor, best[1])
            reached = self._first(self._sorted(others(raised))[:_IMPROVED])
            if reached is None:
                return best
            best = reached
        return best

    def _first(self, tried: Iterable[Found]) -> Found | None:
        """Return the first placement that reaches the goal; its start is shifted if needed."""
        for found in tried:
            better = found if found[0] >= self._goal else self._improved(found)
            if better[0] >= self._goal:
                return better
        return None

    def _improved(self, found: Found) -> Found:
        """Shift the start by the motion that was cut off; repeat this while the shift increases the followed share."""
        for _ in range(_ROUNDS):
            if found[0] >= 1.0:
                break
            tried = self._sorted(self._moved(found[1]))
            if not tried or tried[0][0] <= found[0]:
                break
            found = tried[0]
        return found

    def _moved(self, placement: Placement) -> list[Placement]:
        """Placements whose start is shifted by the motion that was cut off up to some sample."""
        self._tell()
        cut = self._walker.walk(placement)
        self._tell()
        whole = self._walker.walk(placement, is_cut=False, is_fast=True)
        starts = []
        for moment in _MOMENTS:
            at = round(moment * (len(cut.asked) - 1))
            start = self._start_at(whole.asked, cut.asked[at], at, placement.start)
            if start is not None:
                starts.append(replace(placement, start=start))
        return starts

    def _start_at(self, whole: Array, cut: Array, at: int, start: tuple[float, ...]) -> tuple[float, ...] | None:
        """Joints from which the whole path passes through the pose ``cut`` at sample ``at``."""
        pose, inverse, T = np.empty(7), whole[at, 3:] * (1.0, -1.0, -1.0, -1.0), np.empty((4, 4))
        pose[:3] = whole[0, :3] + cut[:3] - whole[at, :3]
        factors = [cut[3:], inverse, whole[0, 3:]]
        if not self._given.tool_axes:  # turns of the hand are those of the tool in the base
            factors.reverse()
        multiply_quaternions(np.ascontiguousarray(factors[0]), np.ascontiguousarray(factors[1]), pose[3:])
        multiply_quaternions(pose[3:], np.ascontiguousarray(factors[2]), pose[3:])
        pose[3:] /= np.linalg.norm(pose[3:])
        transform_from_pose(pose, T)
        answer = self._walker.robot.ik(T, np.array(start))
        return self._rounded(answer.q) if answer.status is IkStatus.FOLLOWED else None

    def _found(self, placement: Placement) -> Found:
        placement = self._aim.aimed(placement)
        if placement not in self._known:
            self._known[placement] = self._share(placement)
        return self._known[placement], placement

    def _share(self, placement: Placement) -> float:
        """Share of the time in which the slave would follow in a session.

        Below the goal it is an upper bound, which takes less time to compute.
        """
        self._tell()
        share = self._walker.share(placement, is_cut=False) + CUT
        if share < self._goal:
            return share
        self._tell()
        return min(share, self._walker.share(placement))

    def _sorted(self, placements: Iterable[Placement]) -> list[Found]:
        """Return placements with their shares, the largest share first; equal shares keep their order."""
        found = [self._found(placement) for placement in dict.fromkeys(placements)]
        return sorted(found, key=_share, reverse=True)

    def _rounded(self, q: Array) -> tuple[float, ...]:
        """Joints to four digits, inside the limits."""
        robot = self._walker.robot
        return tuple(np.clip(np.round(q, _DIGITS), robot.lower, robot.upper).tolist())

    def _factor(self, placement: Placement) -> float:
        return placement.coarse_gain / self._given.coarse_gain

    def _scaled(self, gains: Placement, factor: float, placement: Placement) -> Placement:
        """Placement whose gains are those of `gains`, multiplied by a factor and cut to three digits."""
        return replace(
            placement,
            coarse_gain=_three_digits(gains.coarse_gain * factor),
            fine_gain=_three_digits(gains.fine_gain * factor),
        )


def _share(found: Found) -> float:
    return found[0]


def _three_digits(value: float) -> float:
    """Round a gain down to three digits, but not below the smallest gain that the parameters allow."""
    digits = 2 - math.floor(math.log10(value))
    return max(math.floor(value * 10.0**digits + 1e-9) / 10.0**digits, 1e-3)
