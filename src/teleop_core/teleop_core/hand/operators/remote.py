"""Remote: a hand whose wanted poses a person or a program sends.

Poses may arrive at a low rate, from a mouse, a gamepad or a program; the stylus follows them smoothly. Before the first
pose, and after a time without poses, the hand counts as absent: the clutch is pressed, so that the slave does not move.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from teleop_core.base import ShapeError, UnknownNameError, Within, fixed
from teleop_core.hand.operators import Motion, Operator, Setting, follower, rest
from teleop_core.kernels import geometry

__all__ = ["REMOTE", "Person", "RemoteHand", "RemoteParameters", "remote_operator"]

AHEAD = follower.MOST
"""Largest number of ticks per call. A new target takes effect at most this many ticks late."""
BUTTONS = ("clutch", "fixture", "mode")
_PRESSED = 0.1  # shortest time for which a button is pressed [s]
_BETWEEN = 0.05  # shortest time for which a button is released between two presses [s]
_UNIT = 1e-3  # tolerance of a quaternion's length
_FARTHEST = 10.0  # poses farther than this from the master's base are refused [m]


@dataclass(frozen=True, kw_only=True)
class RemoteParameters:
    """How a hand follows the poses that a remote person wants."""

    delay: float = fixed(
        0.045,
        Within(0.005, 0.5, "s"),
        "delay of the stylus behind a commanded motion of constant speed",
        source="assumed: smooths 30 to 60 poses per second; less than a third of the delay that people feel",
    )
    timeout: float = fixed(
        0.2,
        Within(0.02, 5.0, "s"),
        "if no pose arrives for this time, the operator lets go of the stylus: the clutch is pressed "
        "until the next pose",
        source="assumed: the time of some six frames of a slow page",
    )
    speed: float = fixed(
        0.5,
        Within(0.01, 2.5, "m/s"),
        "largest speed of the stylus",
        source="assumed: crosses the Phantom's workspace in a third of a second",
    )
    acceleration: float = fixed(
        30.0,
        Within(0.1, 500.0, "m/s²"),
        "largest acceleration of the stylus",
        source="assumed: three times that of a free fall",
    )
    turn_speed: float = fixed(
        6.0,
        Within(0.05, 50.0, "rad/s"),
        "largest angular speed of the stylus",
        source="assumed: about one turn a second",
    )
    turn_acceleration: float = fixed(
        300.0,
        Within(1.0, 5000.0, "rad/s²"),
        "largest angular acceleration of the stylus",
        source="assumed: reaches turn_speed in half of the delay",
    )


Person = Callable[["RemoteHand", float], None]
"""A program in place of a person: sets the wanted pose of a hand at a time [s] since the hand began to move."""


class _Wanted(NamedTuple):
    """The last wanted pose.

    ``time`` is the time of the pose [s]; NaN means the time at which the pose is first read. ``grip`` is the number of
    times that the stylus was released before.
    """

    pose: geometry.Array
    time: float
    grip: int


class RemoteHand:
    """Hand of a remote person: follows wanted poses, and releases the stylus when no poses arrive.

    A grip is relative: its first pose corresponds to the present pose of the stylus, and later poses move the stylus by
    their difference from the first pose. :meth:`motion` may be called by a different thread than :meth:`want`,
    :meth:`press` and :meth:`let_go`.

    Args:
        parameters: Delay, timeout and bounds.
        start: Pose (7,) of the stylus at the beginning: position [m] in the master's base, quaternion w, x, y, z; None
            for the rest pose of the haptic master's stylus.
        room: Low and high corner (3,) [m] of the box that bounds the stylus; None for no bound.

    Attributes:
        room: Low and high corner (3,) [m] of the box that bounds the stylus.
        closing: Share by which the hand closes the jaw, 0 open to 1 closed; it does not change when no poses arrive.
        refused: Number of poses that were not used.
    """

    def __init__(
        self,
        parameters: RemoteParameters | None = None,
        start: geometry.Array | None = None,
        room: tuple[geometry.Array, geometry.Array] | None = None,
    ) -> None:
        p = self._parameters = parameters or RemoteParameters()
        begin = rest.rest_pose() if start is None else _row("start", start)
        corners = (np.full(3, -_FARTHEST), np.full(3, _FARTHEST)) if room is None else room
        self.room = corners
        self._follower = follower.Follower(
            p.delay, (p.speed, p.turn_speed), (p.acceleration, p.turn_acceleration), begin, corners
        )
        self._wanted = self._seen = _Wanted(begin, math.nan, 0)
        self._end, self._shown = -math.inf, (False, False, False)
        self._start = begin
        self._first, self._held, self._turn = begin, begin, np.array([1.0, 0.0, 0.0, 0.0])
        self._is_held = False
        self._down = dict.fromkeys(BUTTONS, False)
        self._buttons = {name: _Button() for name in BUTTONS[1:]}
        self.refused, self.closing = 0, 0.0

    # -- what the person wants, in any thread ----------------------------------------------------

    def want(self, pose: geometry.Array, time: float | None = None) -> bool:
        """Set the wanted pose; the first pose of a grip corresponds to the present pose of the stylus.

        Args:
            pose: Position [m] in the master's base and quaternion w, x, y, z of unit length, (7,).
            time: Time of the wanted pose, in the time of :meth:`motion` [s]; None for now.

        Returns:
            Whether the pose is used. A pose is refused if it is not finite, is more than 10 m away, or has no unit
            quaternion.

        Raises:
            ShapeError: ``pose`` does not have the shape (7,).
        """
        row = _row("pose", pose)
        numbers = row.tolist()
        is_sound = (
            all(map(math.isfinite, numbers))
            and abs(math.hypot(*numbers[3:]) - 1.0) <= _UNIT
            and max(map(abs, numbers[:3])) <= _FARTHEST
        )
        if not is_sound:
            self.refused += 1
            return False
        row[3:] /= math.hypot(*numbers[3:])
        self._wanted = _Wanted(row, math.nan if time is None else time, self._wanted.grip)
        return True

    def let_go(self) -> None:
        """Release the stylus now; the next pose begins a new grip."""
        self._wanted = _Wanted(self._wanted.pose, -math.inf, self._wanted.grip + 1)

    def press(self, name: str, *, is_pressed: bool = True) -> None:
        """Press or release a button; each new press of fixture or mode lasts at least 0.1 s.

        Args:
            name: ``clutch``, ``fixture`` or ``mode``.
            is_pressed: Whether the button is pressed from now on.

        Raises:
            UnknownNameError: There is no such button.
        """
        if name not in BUTTONS:
            raise UnknownNameError("button", name, BUTTONS)
        if is_pressed and not self._down[name] and name in self._buttons:
            self._buttons[name].presses += 1
        self._down[name] = is_pressed

    def close(self, share: float) -> None:
        """Close the jaw to ``share``, 0 open to 1 closed. Other values are clipped; NaN changes nothing."""
        if not math.isnan(share):
            self.closing = min(max(share, 0.0), 1.0)

    def tap(self, name: str) -> None:
        """Press and release a button; raises as :meth:`press`."""
        self.press(name)
        self.press(name, is_pressed=False)

    # -- what the stylus does --------------------------------------------------------------------

    @property
    def is_held(self) -> bool:
        """Whether a person or program holds the stylus."""
        return self._is_held

    @property
    def pose(self) -> geometry.Array:
        """Present pose (7,) of the stylus that the hand wants, in the master's base."""
        return self._follower.pose

    @property
    def time(self) -> float:
        """Time up to which the motion is computed [s]."""
        return self._follower.time

    def motion(self, times: geometry.Array) -> geometry.Array:
        """Motion of the stylus: the :data:`~teleop_core.hand.operators.Motion` of an operator.

        Args:
            times: Times (N,) [s] of successive ticks, later than the times of the last call.

        Returns:
            Rows (N, 13): position and rotation vector relative to the start, buttons, zero tremor, and the jaw.
        """
        rows = np.zeros((len(times), 13))
        tick = float(times[1] - times[0]) if len(times) > 1 else 0.0
        for first in range(0, len(times), follower.MOST):
            part = rows[first : first + follower.MOST]
            drawn = self.draw(float(times[first]), tick, len(part))
            part[:, :3] = drawn["wanted"] - self._start[:3]
            part[:, 6:9], part[:, 12] = drawn["buttons"], drawn["jaw"]
            for row, wanted in zip(part, drawn, strict=True):
                geometry.turn_within(self._start[3:], wanted["attitude"], row[3:6])
        return rows

    __call__ = motion

    def draw(self, first: float, tick: float, count: int) -> Any:
        """Return the motion of a few ticks as records, in the form for the haptic master.

        Args:
            first: Time of the first tick [s].
            tick: Length of a tick [s].
            count: Number of ticks, 1 to 4.

        Returns:
            Records (count,) of :class:`teleop_core.hand.operators.follower.Wanted`: positions and attitudes in the
            master's base. The next call overwrites them.
        """
        if self._wanted is not self._seen:
            self._listen(first)
        if self._is_held and first > self._end:
            self._release()
        fixture, mode = self._buttons.values()
        pressed = (
            self._down["clutch"] or not self._is_held,
            fixture.at(first, is_down=self._down["fixture"]),
            mode.at(first, is_down=self._down["mode"]),
        )
        if pressed != self._shown:
            self._follower.press(pressed)
            self._shown = pressed
        rows = self._follower.go_on(first, tick, count)
        rows["jaw"] = self.closing
        return rows

    def _listen(self, now: float) -> None:
        wanted, before = self._wanted, self._seen
        self._seen = wanted
        came = now if math.isnan(wanted.time) else min(wanted.time, now)
        if wanted.grip != before.grip or came > self._end:
            self._release()
        self._end = came + self._parameters.timeout
        if now > self._end:
            return
        if not self._is_held:
            self._is_held = True
            self._first, self._held = wanted.pose, self._follower.pose
            geometry.invert_quaternion(self._first[3:], self._turn)
        self._follower.aim(self._moved(wanted.pose))

    def _moved(self, pose: geometry.Array) -> geometry.Array:
        """Pose of the stylus at the grip, moved by the change of the wanted pose since then."""
        target = np.empty(7)
        target[:3] = self._held[:3] + (pose[:3] - self._first[:3])
        geometry.multiply_quaternions(pose[3:], self._turn, target[3:])
        geometry.multiply_quaternions(target[3:], self._held[3:], target[3:])
        return target

    def _release(self) -> None:
        if self._is_held:
            self._is_held = False
            self._follower.brake()


class _Button:
    """Button whose presses are never missed, even if presses and pauses are very short.

    Attributes:
        presses: Number of presses so far.
    """

    def __init__(self) -> None:
        self.presses = self._shown = 0
        self._until = self._next = -math.inf
        self._is_pressed = False

    def at(self, now: float, *, is_down: bool) -> bool:
        """Whether the button is pressed at the time ``now`` [s], which increases from call to call.

        The button is released between two presses, even if there was no call between them.
        """
        if self._shown < self.presses and now >= self._next:
            if self._is_pressed:
                self._until, self._next = -math.inf, now + _BETWEEN
            else:
                self._shown += 1
                self._until = now + _PRESSED
                self._next = self._until + _BETWEEN
        is_last = self._shown == self.presses
        if is_down and is_last and self._shown:
            self._until = max(self._until, now)
            self._next = now + _BETWEEN
        self._is_pressed = now <= self._until
        return self._is_pressed


def _row(name: str, pose: object) -> geometry.Array:
    """Copy of a pose (7,).

    Raises:
        ShapeError: ``pose`` does not have the shape (7,).
    """
    row = np.array(pose, dtype=np.float64)
    if row.shape != (7,):
        raise ShapeError(name, (7,), row.shape)
    return row


def hand_of(setting: Setting) -> RemoteHand:
    """Hand for a session, within the range of its device; the hand's parameters are ``operator.remote``."""
    p = cast(RemoteParameters, setting.common.kind.groups["remote"])
    start, (low, high) = rest.rest_pose(), setting.common.device.corners
    return RemoteHand(p, start, (start[:3] + low, start[:3] + high))


def make_remote(_: object, setting: Setting) -> Motion:
    """Make a remote hand; callers that send poses get the hand as ``hand`` of the stage ``operator``."""
    return hand_of(setting)


REMOTE = Operator("remote", make_remote, RemoteParameters, ahead=AHEAD, trembles=True)


def remote_operator(name: str, person: Person) -> Operator:
    """Return an operator whose hand gets its wanted poses from a program.

    The parameters of the hand are ``operator.remote``.

    Args:
        name: Name of the operator.
        person: Called once every 4 ticks. It may call :meth:`RemoteHand.want`, :meth:`RemoteHand.let_go` and
            :meth:`RemoteHand.press` any number of times.
    """

    def make(_: object, setting: Setting) -> Motion:
        hand = hand_of(setting)

        def motion(times: geometry.Array) -> geometry.Array:
            person(hand, float(times[0]))
            return hand.motion(times)

        return motion

    return Operator(name, make, ahead=AHEAD, trembles=True)
