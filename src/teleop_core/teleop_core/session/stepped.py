"""Stepped: a session for a program that moves the hand step by step and reads named values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from teleop_core.base import ParameterError, SessionError, ShapeError, UnknownNameError
from teleop_core.graph import STATE, TICK_NS, topics
from teleop_core.graph.operation import State
from teleop_core.hand.master.haptic_master import HapticMasterParameters
from teleop_core.hand.operators import Operator
from teleop_core.kernels.geometry import Array
from teleop_core.session import api, virtual

_NUMBERS = count()
_STATE = topics.OPERATION.index("state")
_PATIENCE = 60.0  # time after which an arm that does not follow counts as failed [s]


@dataclass(frozen=True, eq=False)
class Space:
    """Bounds of values, in the form of ``gymnasium.spaces.Box(space.low, space.high)``.

    Attributes:
        low: Lower bounds (n,).
        high: Upper bounds (n,).
        names: Name of each value (n,).
    """

    low: Array
    high: Array
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Observation:
    """State of a session after a step; arrays are copies, in SI units.

    Attributes:
        time: Time since the session began [s].
        measured_jp: Joint positions of the slave (n,) [rad or m].
        measured_jv: Joint speeds of the slave (n,) [rad/s or m/s].
        measured_cp: Pose (7,) of the slave's tip in the slave's base: x, y, z [m], quaternion w, x, y, z.
        measured_cf: Force and moment (6,) on the slave's tip, in the slave's base [N, N·m].
        servo_cp: Pose (7,) that the hand commands, in the slave's base.
        master_cp: Pose (7,) of the stylus in the master's base.
        master_cf: Force and moment (6,) on the hand, in the master's base [N, N·m].
        gain: Ratio of the tip's motion to the hand's motion.
        is_following: Whether the arm follows the hand.
        state: Operating state of the arm.
    """

    time: float
    measured_jp: Array
    measured_jv: Array
    measured_cp: Array
    measured_cf: Array
    servo_cp: Array
    master_cp: Array
    master_cf: Array
    gain: float
    is_following: bool
    state: State


class Session:
    """A session whose hand a program moves: :meth:`command`, :meth:`step`, :meth:`observe`.

    >>> session = Session("free_motion")
    >>> begin = session.reset().measured_cp[:3]
    >>> session.command([0.0, 0.01, 0.0])  # the hand goes up by a centimetre
    >>> end = session.step(50).measured_cp[:3]  # 50 steps of 20 ms; the tip arrives in the first of them

    When the session begins, and after :meth:`reset`, the arm already follows the hand. All other stages run as in
    every session. The same commands give bit-identical results.

    Args:
        scenario: Name of a scenario, as in ``teleop scenarios``; None for the defaults alone.
        files: ROS 2 parameter files that override the scenario.
        settings: Parameters by name, which override all files: ``{"robot": "puma560"}``. The program moves the hand,
            so the hand has tremor only if ``tremor_amplitude`` is set.
        period: Time of a step [s], in whole milliseconds.

    Attributes:
        command_space: Bounds of the values of :meth:`command`: position [m] and rotation [rad] of the stylus, relative
            to its start, in the master's base.
        runner: The underlying session, with the rows of all its topics.

    Raises:
        TeleopError: An argument is wrong; the error text names it.
    """

    def __init__(
        self,
        scenario: str | None = None,
        *,
        files: Iterable[Path | str] = (),
        settings: Mapping[str, api.Setting] | None = None,
        period: float = 0.02,
    ) -> None:
        self._ticks = round(period * 1e9 / TICK_NS)
        if not (self._ticks >= 1 and abs(self._ticks * TICK_NS - period * 1e9) < 1.0):
            raise ParameterError("period", period, "whole milliseconds, 0.001 or more")
        hand = Operator(f"program_{next(_NUMBERS)}", lambda *_: self._motion, ahead=self._ticks)
        given: dict[str, api.Setting] = {"tremor_amplitude": 0.0} | dict(settings or {})
        made = api.configuration(scenario, files=files, settings=given, operator=hand)
        self.runner = virtual.VirtualTime(made)
        half = 0.5 * np.array(made.of(HapticMasterParameters).device.workspace)
        most = np.array([*half, *[np.pi] * 3])
        names = ("x", "y", "z", "turn_x", "turn_y", "turn_z")
        self.command_space = Space(-most, most, names)
        self._last, self._now, self._next = np.zeros((3, 13))
        self._made = 0
        self._row = self.runner.rows(1)[0]

    def command(
        self,
        place: Array | Sequence[float],
        turn: Array | Sequence[float] = (0.0, 0.0, 0.0),
        *,
        clutch: bool = False,
        fixture: bool = False,
        mode: bool = False,
        jaw: float = 0.0,
    ) -> None:
        """Set the pose of the hand at the end of the next step; the hand moves there at constant speed.

        Args:
            place: Position of the stylus (3,), relative to its start, in the master's base [m].
            turn: Rotation vector (3,) of the stylus [rad].
            clutch: Whether the clutch is pressed, so that the slave stays where it is.
            fixture: Whether the button of the fixture is pressed.
            mode: Whether the button that switches between coarse and fine mode is pressed.
            jaw: Closing of the jaw, 0 open to 1 closed.

        Raises:
            ShapeError: ``place`` or ``turn`` does not have the shape (3,).
            ParameterError: A value is not finite, or not in :attr:`command_space`.
        """
        for name, values in (("place", place), ("turn", turn)):
            if np.shape(values) != (3,):
                raise ShapeError(name, (3,), np.shape(values))
        wanted = np.array([*place, *turn], dtype=np.float64)
        space = self.command_space
        for name, value, low, high in zip(space.names, wanted, space.low, space.high, strict=True):
            if not low <= value <= high:
                raise ParameterError(name, value, f"{low:g} to {high:g}")
        if not 0.0 <= jaw <= 1.0:
            raise ParameterError("jaw", jaw, "0 to 1")
        self._last, self._made = self._now, 0
        self._next = np.array([*wanted, clutch, fixture, mode, 0.0, 0.0, 0.0, jaw])

    def step(self, count: int = 1) -> Observation:
        """Run some steps and return the observation after them.

        Args:
            count: Number of steps. The hand reaches its command in the first step and stays there.
        """
        for _ in range(count):
            self._row = self.runner.run(self._ticks)[-1]
        return self.observe()

    def reset(self) -> Observation:
        """Restart the session: the hand is at rest at its start, and the arm follows it.

        Raises:
            SessionError: The arm does not follow.
        """
        self._last, self._now, self._next = np.zeros((3, 13))
        self.runner.reset()
        self.step(-(-self.runner.lead // self._ticks))
        while not (found := self.step()).is_following:
            if found.time > _PATIENCE:
                raise SessionError(f"the arm does not follow: its state is {found.state.name}")
        return found

    def observe(self) -> Observation:
        """Observation after the last step."""
        row, state = self._row, self.values("teleop/state")
        places, speeds, _ = self.values("slave/measured_js").reshape(3, -1)
        return Observation(
            time=self.runner.now_ns * 1e-9,
            measured_jp=places,
            measured_jv=speeds,
            measured_cp=self.values("slave/measured_cp"),
            measured_cf=self.values("slave/measured_cf"),
            servo_cp=self.values("slave/servo_cp"),
            master_cp=self.values("master/measured_cp"),
            master_cf=self.values("master/servo_cf"),
            gain=float(state[STATE["gain"]]),
            is_following=bool(state[STATE["is_following"]] > 0.0),
            state=State(int(row["slave_operation"][_STATE])),
        )

    def values(self, topic: str) -> Array:
        """Newest values of a topic, shape (width,), in the order of its columns.

        Args:
            topic: Name of the topic, such as ``task/state``, or ``left/slave/measured_cp`` of another arm.

        Raises:
            UnknownNameError: The session has no such topic.
        """
        field = topic.replace("/", "_")
        if field not in (self._row.dtype.names or ()):
            names = (one.name for member in self.runner.graph.members for one in member.writes)
            raise UnknownNameError("topic", topic, tuple(names))
        return np.array(self._row[field], dtype=np.float64)

    def _motion(self, times: Array) -> Array:
        """Rows (N, 13) of the hand, at constant speed from its last command to the next command."""
        share = np.arange(self._made + 1, self._made + len(times) + 1)[:, None] / self._ticks
        self._made += len(times)
        rows = self._last + np.minimum(share, 1.0) * (self._next - self._last)
        rows[:, 6:9], self._now = self._next[6:9], rows[-1]
        return rows
