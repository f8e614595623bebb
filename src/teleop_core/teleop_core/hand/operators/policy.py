"""Policy: an operator that is a function of what it sees, written or trained.

The function moves the hand, not the arm. So mapping, fixtures, limits, stops and faults hold for it as for a person,
and it sees the slave as late as the display and the network show it.
"""

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, PartError, Registry, ShapeError, Within, fixed
from teleop_core.base.registry import tried
from teleop_core.graph import STATE, topics
from teleop_core.hand.operators import Motion, Operator, Setting, follower
from teleop_core.kernels import Array, length, product
from teleop_core.kernels.axes import axis_map

__all__ = ["GIVE_WAY", "POLICIES", "POLICY", "HandOver", "Policy", "View", "checked_place", "register_policy"]

GIVE_WAY = 0.01
"""Default of the speed at which the shift of a hand-over shrinks [m/s]."""
_GOAL = topics.TASK_STATE.columns.index("goal_x")


@dataclass(frozen=True, eq=False)
class View:
    """Data that a policy sees and feels at one moment; arrays are copies, in SI units.

    What also an :class:`~teleop_core.session.stepped.Observation` contains has the same name there.

    Attributes:
        time: Time since the slave first followed [s].
        measured_cp: Pose (7,) of the slave's tip in the slave's base, as the display or the network shows it.
        age: Time since ``measured_cp`` was measured [s].
        master_cp: Pose (7,) of the stylus in the master's base.
        master_cf: Force and torque (6,) of the device on the hand, in the master's base [N, N·m].
        state: Numbers of ``teleop/state``, as :data:`~teleop_core.graph.topics.TELEOP_STATE` names them.
        task: Numbers of ``task/state``, as :data:`~teleop_core.graph.topics.TASK_STATE` names them,
            zero before the task begins.
        place: Present wanted place of the hand (3,) [m], relative to its start, in the master's base.
        jaw: Closing of the jaw that the hand wants, 0 open to 1 closed.
        hand_of_slave: Rotation (3, 3) from the slave's base to the master's base.
    """

    time: float
    measured_cp: Array
    age: float
    master_cp: Array
    master_cf: Array
    state: Array
    task: Array
    place: Array
    jaw: float
    hand_of_slave: Array

    @property
    def gain(self) -> float:
        """Ratio of the tip's motion to the hand's motion; 1 before it is known."""
        return float(self.state[STATE["gain"]]) or 1.0

    @property
    def is_following(self) -> bool:
        """Whether the arm follows the hand."""
        return bool(self.state[STATE["is_following"]] > 0.0)

    @property
    def goal(self) -> Array | None:
        """Position of the task's goal (3,) in the slave's base [m]; None without a task, and before it begins."""
        return self.task[_GOAL : _GOAL + 3] if self.task[0] > 0.0 else None

    def to_hand(self, way: Array) -> Array:
        """Displacement (3,) [m] of the hand that moves the tip by ``way`` (3,) [m], in the slave's base."""
        return product(self.hand_of_slave, way) / self.gain


Policy = Callable[[View], Array]
"""What a policy is: it takes a view, and returns the wanted place of the hand (3,) [m], relative to its start and in
the master's base, or (4,) with the closing of the jaw, 0 to 1.
"""


class HandOver:
    """Shift of the places of whoever takes over the hand, so that the hand does not jump.

    The first place is shifted to where the hand is. The shift then shrinks at a bounded speed, so that the hand comes
    to the wanted places by itself.

    Args:
        give_way: Largest speed at which the shift shrinks [m/s].

    Raises:
        ParameterError: ``give_way`` is not above 0, or is above 1 m/s.
    """

    def __init__(self, give_way: float = GIVE_WAY) -> None:
        if not 0.0 < give_way <= 1.0:
            raise ParameterError("give_way", give_way, "above 0, up to 1 m/s")
        self._speed, self._shift, self._is_new = give_way, np.zeros(3), True

    def begin(self) -> None:
        """Let another policy or person take over with the next place."""
        self._is_new = True

    def place(self, wanted: Array, hand: Array, passed: float) -> Array:
        """Place for the hand (3,) [m].

        Args:
            wanted: Place (3,) [m] that is wanted.
            hand: Place (3,) [m] where the hand is.
            passed: Time since the last call [s].
        """
        if self._is_new:
            self._shift, self._is_new = hand - wanted, False
        else:
            left = float(length(self._shift))
            self._shift = self._shift * max(0.0, 1.0 - self._speed * passed / max(left, 1e-12))
        return np.asarray(wanted + self._shift)


def checked_place(found: object, shapes: tuple[tuple[int], ...] = ((3,), (4,))) -> Array:
    """Answer of a policy as an array.

    Args:
        found: The answer.
        shapes: Allowed shapes.

    Raises:
        ShapeError: The answer has another shape.
        ParameterError: A number is not finite.
    """
    place = np.asarray(found, np.float64)
    if place.shape not in shapes:
        raise ShapeError("place of the policy", shapes[0], place.shape)
    if not np.isfinite(place).all():
        raise ParameterError("place of the policy", place.tolist(), "finite numbers")
    return place


def _checked(name: str, part: object) -> "Policy | type[Policy]":
    if not callable(part):
        raise PartError("policy", name, f"a function of a view, or a class of such functions, not {part!r}")
    return part


POLICIES: "Registry[Policy | type[Policy]]" = Registry("policy", "policies", {}, _checked)
"""All policies by name. Configurations name policies, and never files: so no recording and no page runs code."""


def register_policy(name: str, policy: "Policy | type[Policy]", *, replace: bool = False) -> "Policy | type[Policy]":
    """Add a policy for the rest of the program; see :meth:`Registry.add`.

    Args:
        name: Name of the policy in ``operator.policy.name``.
        policy: A function of a :class:`View`, or a class without arguments whose instances are such functions; each
            session makes an instance of its own, for policies with a memory.
        replace: Whether it may replace a policy that the program added before.
    """
    return POLICIES.add(name, policy, replace=replace)


@dataclass(frozen=True, kw_only=True)
class PolicyParameters:
    """Which policy moves the hand, and how often it is asked."""

    name: str = fixed("", doc="name of a policy that register_policy added, or an installed package")
    rate: float = fixed(
        50.0, Within(1.0, 250.0, "Hz"), "how often the policy is asked; in between, the hand moves evenly"
    )
    give_way: float = fixed(
        GIVE_WAY,
        Within(1e-4, 1.0, "m/s"),
        "speed at which the shift of a hand-over shrinks; the policy's first place is shifted to where the hand is",
    )
    axes: tuple[str, ...] = fixed(
        ("-z", "-x", "+y"), length=3, doc="axes of the hand along x, y, z of the slave; the same as motion_scaling.axes"
    )


class _Piloted:
    """Motion of one session: even from each wanted place to the next one."""

    def __init__(self, p: PolicyParameters, setting: Setting) -> None:
        assert setting.seen is not None
        self._name, self._seen, self._period = p.name, setting.seen, 1.0 / p.rate
        self._hand_over, self._corners = HandOver(p.give_way), setting.common.device.corners
        self._hand_of_slave = axis_map("operator.policy.axes", p.axes).T
        found = POLICIES.find(p.name)
        with self._tried("one that can be made without arguments"):
            self._policy = found() if isinstance(found, type) else found
        self._begin, self._due, self._jaw = 0.0, -math.inf, 0.0
        self._from, self._to = np.zeros((2, 3))

    def __call__(self, times: Array) -> Array:
        """Rows (N, 13) of :data:`~teleop_core.hand.operators.Motion` for times (N,) [s]."""
        rows = np.zeros((len(times), 13))
        for row, time in zip(rows, times.tolist(), strict=True):
            if time >= self._due and not math.isinf(self._seen.age()):  # before, there is nothing to see
                self._decide(time)
            row[:3], row[12] = self._place(time), self._jaw
        return rows

    def _place(self, time: float) -> Array:
        share = min((time - self._begin) / self._period, 1.0)
        return np.asarray(self._from + share * (self._to - self._from))

    def _decide(self, time: float) -> None:
        """Ask the policy, and move evenly to its place within a period."""
        hand = self._place(time)
        with self._tried(f"one that returns a place (3,), or (4,) with the jaw; at {time:g} s it does not"):
            wanted = checked_place(self._policy(self._view(time, hand)))
        place = self._hand_over.place(wanted[:3], hand, time - self._begin)
        self._from, self._to, self._begin = hand, np.clip(place, *self._corners), time
        is_late = self._due < time - self._period
        self._due = (time if is_late else self._due) + self._period
        if len(wanted) > 3:
            self._jaw = min(max(float(wanted[3]), 0.0), 1.0)

    def _view(self, time: float, hand: Array) -> View:
        seen = self._seen
        arrays = (seen.stylus, seen.force, seen.state, seen.task, hand)
        stylus, force, state, task, place = (np.array(one) for one in arrays)
        tip, turn = np.array(seen.slave), self._hand_of_slave.copy()
        return View(time, tip, seen.age(), stylus, force, state, task, place, self._jaw, turn)

    def _tried(self, needs: str) -> AbstractContextManager[None]:
        return tried("policy", self._name, needs)


def _make(p: PolicyParameters, setting: Setting) -> Motion:
    """Motion of one session.

    Raises:
        ParameterError: No policy is named.
        UnknownNameError: No policy has this name.
        PartError: The policy cannot be made.
    """
    if not p.name:
        known = ", ".join(POLICIES) or "none is registered; name its file: --parts FILE.py"
        raise ParameterError("operator.policy.name", "", f"the name of a policy ({known})")
    return _Piloted(p, setting)


POLICY = Operator("policy", _make, PolicyParameters, ahead=follower.MOST, trembles=True)
