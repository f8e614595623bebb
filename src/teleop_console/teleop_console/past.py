"""Past: numbers of a session over time, by name; they were recorded, or received by the page."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_console.link import ArmView, ShownArm, View
from teleop_console.recorded_arms import in_words
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot

ERROR = "tracking error"
"""Name of the column with the distance between setpoint and measured tip [m], as in the score ``position_error_mm``; no
topic contains this distance."""
DELAY = "session command_delay"
"""Name of the column with the median delay from master sample to slave command [s]; only live sessions have it."""
ROWS = 4000
"""Number of views that are stored of a live session: two minutes at 30 Hz."""
_UNITS = {
    topics.Kind.POSE: ("m",) * 3 + ("",) * 4,
    topics.Kind.TWIST: ("m/s",) * 3 + ("rad/s",) * 3,
    topics.Kind.WRENCH: ("N",) * 3 + ("N·m",) * 3,
    topics.Kind.JAW: ("rad", "rad/s", "N·m"),
}
_UNIT_OF = {
    name: unit
    for unit, names in {
        "m": "x y z position_residual cut_x cut_y cut_z goal_x goal_y goal_z width way off travel slid "
        "drift_x drift_y drift_z fixture_center_x fixture_center_y fixture_center_z fixture_size_x "
        "fixture_size_y fixture_size_z",
        "J": "taken returned friction energy_in energy_out told heard margin withheld turn_in turn_out",
        "N": "largest_force force pull",
        "s": "time rest_time round clock_ahead",
        "rad": "rotation_residual cut_rx cut_ry cut_rz jaw",
        "N·s/m": "impedance",
    }.items()
    for name in names.split()
}
"""Unit of each number that is named in ``topics.py``."""


@dataclass(frozen=True)
class Column:
    """A number over time.

    Attributes:
        topic: Topic of the number, after the namespace of the arm.
        index: Index of the number in a row of the topic.
        unit: Unit of the number; empty for a number without unit.
        is_held: Whether each value is valid until the next value, as in reports.
    """

    topic: str
    index: int
    unit: str
    is_held: bool = False


Rows = tuple[Array, Array]
"""Times (N,) [s], ascending, and values (N, width) or (N,)."""
NOTHING: Rows = (np.empty(0), np.empty((0, 3)))
"""Rows of an unknown topic."""
_ROUNDING = 1e-7  # of times [s]
_NO_SAMPLES: Rows = (np.empty(0), np.empty(0))


class Past(ABC):
    """Columns of a session; methods may be called from any thread.

    Attributes:
        columns: Columns by name, such as ``left/slave/measured_cp x``. The mapping grows while other threads read it,
            so these threads must iterate over a copy.
        joints: Names of the joints of each arm, by namespace.
    """

    columns: dict[str, Column]
    joints: Mapping[str, tuple[str, ...]]

    def __init__(self) -> None:
        self.columns = {}
        self._lag = 0.0  # time between a setpoint and the measured pose that was sampled with it [s]
        # tracking errors by arm, with the rows from which the errors were computed
        self._errors: dict[str, tuple[Rows, Rows, Rows]] = {}

    @abstractmethod
    def rows(self, topic: str) -> Rows | None:
        """All rows of a topic, empty for an unknown topic; None while the recording is still being read."""

    def marks(self) -> Sequence[tuple[float, str]]:
        """Times [s] and texts of the marks."""
        return ()

    def samples(self, name: str) -> Rows | None:
        """Times (N,) [s] and values (N,) of a column; None while the recording is still being read."""
        column = self.columns[name]
        if not name.endswith(ERROR):
            found = self.rows(column.topic)
            if found is None or column.index >= found[1].shape[1]:  # an earlier version recorded fewer columns
                return None if found is None else _NO_SAMPLES
            return found[0], found[1][:, column.index]
        arm = name.removesuffix(ERROR)
        wanted, found = self.rows(arm + topics.SLAVE_SETPOINT_CP.name), self.rows(arm + topics.SLAVE_MEASURED_CP.name)
        if wanted is None or found is None:
            return None
        known = self._errors.get(arm)
        if known is not None and known[0] is wanted and known[1] is found:
            return known[2]
        at = np.searchsorted(wanted[0], found[0] - self._lag + _ROUNDING, side="right") - 1
        if not len(wanted[0]):
            return found[0], np.full(len(at), np.nan)
        away = np.linalg.norm(found[1][:, :3] - wanted[1][np.maximum(at, 0), :3], axis=1)
        errors = found[0], np.where(at < 0, np.nan, away)
        self._errors[arm] = (wanted, found, errors)
        return errors

    def _add(self, arm: str, topic: str, names: Sequence[str], units: Sequence[str], *, is_held: bool = False) -> None:
        """Add the columns of a topic."""
        for index, (name, unit) in enumerate(zip(names, units, strict=True)):
            self.columns[f"{below(arm, topic)} {name}"] = Column(below(arm, topic), index, unit, is_held)
        if topic == topics.SLAVE_MEASURED_CP.name:
            self.columns[below(arm, ERROR)] = Column(below(arm, topic), 0, "m")

    def _add_known(self, arm: str, topic: str, kind: topics.Kind, joints: tuple[str, ...], robot: Robot | None) -> None:
        """Add the columns of a topic of a known kind; nobody plots the poses of all bodies of a scene."""
        if kind is topics.Kind.POSES:
            return
        known = topics.BY_NAME.get(topic)
        names = known.columns if known is not None and known.columns else kind.columns(joints)
        units = _UNITS.get(kind) or [_UNIT_OF.get(name, "") for name in names]
        if kind.has_joints:
            units = _of_joints(kind, len(names), robot)
        self._add(arm, topic, names, units, is_held=kind is topics.Kind.REPORT)


class Views(Past):
    """Views of a live session that the page received in the last minutes, with a row for each view.

    Args:
        arms: The arms.
    """

    def __init__(self, arms: Sequence[ShownArm]) -> None:
        super().__init__()
        self._arms = {arm.name: arm for arm in arms}
        self.joints = {arm.name: arm.robot.joint_names for arm in arms}
        self._lock = threading.Lock()
        self._marks: tuple[tuple[float, str], ...] = ()
        self._times, self._rings, self._count = np.full(ROWS, np.nan), dict[tuple[str, str], Array](), 0
        self.columns = {below(arm.name, ERROR): Column("", 0, "m") for arm in arms} | {DELAY: Column(DELAY, 0, "s")}

    def add(self, view: View) -> None:
        """Add a view. If its time is before the last view, all rows are cleared first.

        A view of the same time, or of a silent session, is not added.
        """
        with self._lock:
            last = self._times[(self._count - 1) % ROWS]
            if self._count and view.time < last:
                self._count = 0
            if not view.is_fresh or (self._count and view.time == last):
                return
            self._marks = view.marks
            row, self._count = self._count % ROWS, self._count + 1
            self._times[row] = view.time
            for ring in self._rings.values():
                ring[row] = np.nan
            self._ring("", DELAY, 1)[row] = view.delay[0]
            for arm, seen in view.arms.items():
                for topic, values in _values(seen):
                    self._ring(arm, topic, len(values))[row] = values

    def marks(self) -> Sequence[tuple[float, str]]:
        """Times [s] and texts of the marks."""
        return self._marks

    def _ring(self, arm: str, topic: str, width: int) -> Array:
        """Ring of rows of a topic; the columns of a new topic are added."""
        found = self._rings.get((arm, topic))
        if found is None:
            found = self._rings[arm, topic] = np.full((ROWS, width), np.nan)
            if topic in topics.BY_NAME:
                robot = self._arms[arm].robot
                self._add_known(arm, topic, topics.BY_NAME[topic].kind, robot.joint_names, robot)
        return found

    def _order(self) -> Any:
        return np.arange(max(0, self._count - ROWS), self._count) % ROWS

    def span(self) -> tuple[float, float]:
        """First and last stored time [s]."""
        with self._lock:
            times = self._times[self._order()]
            return (float(times[0]), float(times[-1])) if len(times) else (0.0, 0.0)

    def rows(self, topic: str) -> Rows | None:
        """All rows of a topic."""
        with self._lock:
            order = self._order()
            found = [ring for key, ring in self._rings.items() if below(*key) == topic]
            return (self._times[order], found[0][order]) if found else NOTHING

    def view(self, time: float) -> View:
        """View at a time [s]; the first stored view if the time is earlier."""
        with self._lock:
            order = self._order()
            at = max(0, int(np.searchsorted(self._times[order], time, side="right")) - 1)
            view = View(time=time, arms={name: ArmView() for name in self._arms}, is_fresh=True)
            for (arm, topic), ring in self._rings.items():
                row = ring[order[at]]
                if topic == DELAY or np.isnan(row).all():
                    continue
                one = view.arms[arm]
                if topic == topics.TELEOP_STATE.name:
                    one.state = dict(zip(topics.TELEOP_STATE.columns, row.tolist(), strict=True))
                elif topic == topics.SLAVE_OPERATION.name:
                    one.operation = dict(zip(topics.OPERATION, row.tolist(), strict=True))
                    one.operation_text = in_words(one.operation, self.joints[arm])
                else:
                    one.streams[topic] = row.copy()
            return view


def below(arm: str, topic: str) -> str:
    """Name of a topic or column with the namespace of an arm."""
    return f"{arm}/{topic}" if arm else topic


def _values(view: ArmView) -> Iterator[tuple[str, Array]]:
    """Known data of an arm, by topic."""
    yield from view.streams.items()
    if view.state:
        yield topics.TELEOP_STATE.name, np.array([view.state[name] for name in topics.TELEOP_STATE.columns])
    if view.operation:
        yield topics.SLAVE_OPERATION.name, np.array([view.operation[name] for name in topics.OPERATION])


def _of_joints(kind: topics.Kind, count: int, robot: Robot | None) -> list[str]:
    """Units of joint positions, followed by the units of velocities and efforts if the topic contains them."""
    joints = count // 3 if kind is topics.Kind.STATE else count
    slides = np.zeros(joints, bool)
    if robot is not None:
        slides = np.linalg.norm(robot.jacobian(robot.home)[3:], axis=0) < 1e-9
    parts = (("m", "rad"), ("m/s", "rad/s"), ("N", "N·m")) if kind is topics.Kind.STATE else (("m", "rad"),)
    return [straight if is_so else turning for straight, turning in parts for is_so in slides.tolist()]
