"""Past: the numbers of a session over time, by name: those that were recorded, or that the page saw."""

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_console.link import Arm, ArmView, View
from teleop_console.recorded_arms import in_words, namespaces, reports_of
from teleop_core.bags.arms import of_arm
from teleop_core.bags.reader import Bag
from teleop_core.bags.recording import MARKS
from teleop_core.bags.series import kind_of
from teleop_core.base.errors import TeleopError
from teleop_core.evaluation.traces import Envelope
from teleop_core.graph.topics import (
    BY_NAME,
    OPERATION,
    REPORTS,
    SLAVE_MEASURED_CP,
    SLAVE_OPERATION,
    SLAVE_SERVO_CP,
    TELEOP_STATE,
    Kind,
)
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot

ERROR = "tracking error"
"""Column of the distance between wanted and measured tip [m], which no topic has."""
DELAY = "session command_delay"
"""Column of the median delay from master sample to slave command [s], of live sessions."""
ROWS = 4000
"""Times that are kept of a live session: two minutes at 30 Hz."""
_KEPT = 8  # topics that are read at once; twice as many are kept
_GATHER = 0.02  # time in which one request asks for all that it needs [s]
_UNITS = {
    Kind.POSE: ("m",) * 3 + ("",) * 4,
    Kind.TWIST: ("m/s",) * 3 + ("rad/s",) * 3,
    Kind.WRENCH: ("N",) * 3 + ("N·m",) * 3,
    Kind.JAW: ("rad", "rad/s", "N·m"),
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
"""Units of numbers that have names of their own in ``topics.py``."""


@dataclass(frozen=True)
class Column:
    """A number over time.

    Attributes:
        topic: Its topic, with the namespace of its arm before it.
        index: Its place in a row of the topic.
        unit: Its unit; empty for a number without one.
        is_held: Whether each value holds until the next one, as of reports.
    """

    topic: str
    index: int
    unit: str
    is_held: bool = False


Rows = tuple[Array, Array]
"""Times (N,) [s], ascending, and values (N, width) or (N,)."""
_NONE: Rows = (np.empty(0), np.empty((0, 3)))
_NO_SAMPLES: Rows = (np.empty(0), np.empty(0))


class Past(ABC):
    """Columns of a session; methods may be called from any thread.

    Attributes:
        columns: By their names, such as ``left/slave/measured_cp x``.
        joints: Names of the joints of each arm, by namespace.
    """

    columns: dict[str, Column]
    joints: Mapping[str, tuple[str, ...]]

    def __init__(self) -> None:
        self.columns = {}
        self._errors: dict[str, tuple[Rows, Rows, Rows]] = {}  # by arms, with what they are made of

    @abstractmethod
    def rows(self, topic: str) -> Rows | None:
        """All rows of a topic, none of an unknown one; None while they are being read."""

    def marks(self) -> Sequence[tuple[float, str]]:
        """Times [s] and texts of the marks that somebody set."""
        return ()

    def samples(self, name: str) -> Rows | None:
        """Times (N,) [s] and values (N,) of a column; None while they are being read."""
        column = self.columns[name]
        if not name.endswith(ERROR):
            found = self.rows(column.topic)
            if found is None or column.index >= found[1].shape[1]:  # an earlier version had fewer
                return None if found is None else _NO_SAMPLES
            return found[0], found[1][:, column.index]
        arm = name.removesuffix(ERROR)
        wanted, found = self.rows(arm + SLAVE_SERVO_CP.name), self.rows(arm + SLAVE_MEASURED_CP.name)
        if wanted is None or found is None:
            return None
        known = self._errors.get(arm)
        if known is not None and known[0] is wanted and known[1] is found:
            return known[2]
        at = np.searchsorted(wanted[0], found[0], side="right") - 1
        if not len(wanted[0]):
            return found[0], np.full(len(at), np.nan)
        away = np.linalg.norm(found[1][:, :3] - wanted[1][np.maximum(at, 0), :3], axis=1)
        errors = found[0], np.where(at < 0, np.nan, away)
        self._errors[arm] = (wanted, found, errors)
        return errors

    def _add(self, arm: str, topic: str, names: Sequence[str], units: Sequence[str], *, is_held: bool = False) -> None:
        """Take note of a topic's columns."""
        for index, (name, unit) in enumerate(zip(names, units, strict=True)):
            self.columns[f"{_below(arm, topic)} {name}"] = Column(_below(arm, topic), index, unit, is_held)
        if topic == SLAVE_MEASURED_CP.name:
            self.columns[_below(arm, ERROR)] = Column(_below(arm, topic), 0, "m")

    def _add_known(self, arm: str, topic: str, kind: Kind, joints: tuple[str, ...], robot: Robot | None) -> None:
        """Take note of the columns of a topic whose kind is known."""
        known = BY_NAME.get(topic)
        names = known.columns if known is not None and known.columns else kind.columns(joints)
        units = _UNITS.get(kind) or [_UNIT_OF.get(name, "") for name in names]
        if kind.has_joints:
            units = _of_joints(kind, len(names), robot)
        self._add(arm, topic, names, units, is_held=kind is Kind.REPORT)


class Seen(Past):
    """What the page has seen of a live session in the last minutes: a row for each look.

    Args:
        arms: The arms.
    """

    def __init__(self, arms: Sequence[Arm]) -> None:
        super().__init__()
        self._arms = {arm.name: arm for arm in arms}
        self.joints = {arm.name: arm.robot.joint_names for arm in arms}
        self._lock = threading.Lock()
        self._times, self._rings, self._count = np.full(ROWS, np.nan), dict[tuple[str, str], Array](), 0
        self.columns = {_below(arm.name, ERROR): Column("", 0, "m") for arm in arms} | {DELAY: Column(DELAY, 0, "s")}

    def add(self, view: View) -> None:
        """Note what is known; an earlier time begins anew, the same one and silence add nothing."""
        with self._lock:
            last = self._times[(self._count - 1) % ROWS]
            if self._count and view.time < last:
                self._count = 0
            if not view.is_fresh or (self._count and view.time == last):
                return
            row, self._count = self._count % ROWS, self._count + 1
            self._times[row] = view.time
            for ring in self._rings.values():
                ring[row] = np.nan
            self._ring("", DELAY, 1)[row] = view.delay[0]
            for arm, seen in view.arms.items():
                for topic, values in _values(seen):
                    self._ring(arm, topic, len(values))[row] = values

    def _ring(self, arm: str, topic: str, width: int) -> Array:
        """Rows of a topic, with its columns noted when it is new."""
        found = self._rings.get((arm, topic))
        if found is None:
            found = self._rings[arm, topic] = np.full((ROWS, width), np.nan)
            if topic in BY_NAME:
                robot = self._arms[arm].robot
                columns = dict(self.columns)  # others read them
                self._add_known(arm, topic, BY_NAME[topic].kind, robot.joint_names, robot)
                self.columns = columns | self.columns
        return found

    def _order(self) -> Any:
        return np.arange(max(0, self._count - ROWS), self._count) % ROWS

    def span(self) -> tuple[float, float]:
        """First and last time [s] that are kept."""
        with self._lock:
            times = self._times[self._order()]
            return (float(times[0]), float(times[-1])) if len(times) else (0.0, 0.0)

    def rows(self, topic: str) -> Rows | None:
        """All rows of a topic."""
        with self._lock:
            order = self._order()
            found = [ring for key, ring in self._rings.items() if _below(*key) == topic]
            return (self._times[order], found[0][order]) if found else _NONE

    def view(self, time: float) -> View:
        """What was known at a time [s]; at the first one that is kept, if that is later."""
        with self._lock:
            order = self._order()
            at = max(0, int(np.searchsorted(self._times[order], time, side="right")) - 1)
            view = View(time=time, arms={name: ArmView() for name in self._arms}, is_fresh=True)
            for (arm, topic), ring in self._rings.items():
                row = ring[order[at]]
                if topic == DELAY or np.isnan(row).all():
                    continue
                one = view.arms[arm]
                if topic == TELEOP_STATE.name:
                    one.state = dict(zip(TELEOP_STATE.columns, row.tolist(), strict=True))
                elif topic == SLAVE_OPERATION.name:
                    one.operation = dict(zip(OPERATION, row.tolist(), strict=True))
                    one.operation_text = in_words(one.operation, self.joints[arm])
                else:
                    one.streams[topic] = row.copy()
            return view


class Recorded(Past):
    """What was recorded: every column of every topic that has numbers.

    A topic is read when it is first asked for, in a thread: reading ten minutes takes five seconds.
    Of recordings beyond eleven minutes the smallest and largest value of short stretches are kept.

    Args:
        bag: The recording.
        robots: Robots of its arms by namespace, where they are known.
    """

    def __init__(self, bag: Bag, robots: Mapping[str, Robot] | None = None) -> None:
        super().__init__()
        robots = robots or {}
        self._start_ns, self._lock = bag.start_ns, threading.Lock()
        self.duration = (bag.end_ns - bag.start_ns) * 1e-9
        self._bags = {name: of_arm(bag, arm) for name, arm in namespaces(bag).items()}
        self.joints = {name: robot.joint_names for name, robot in robots.items()}
        self._end_ns = bag.end_ns
        self._marks: tuple[tuple[float, str], ...] | None = None
        self._read: dict[str, Rows] = {}
        self._wanted, self._is_reading = set[str](), False
        self._topics = {_below(arm, topic): (arm, topic) for arm, one in self._bags.items() for topic in one.topics}
        for arm, topic in self._topics.values():
            self._note(arm, topic, robots.get(arm))

    def _note(self, arm: str, topic: str, robot: Robot | None) -> None:
        """Take note of a topic's columns, where its messages are numbers."""
        info = self._bags[arm].topics[topic]
        kind, known = kind_of(topic, info.type), topic in BY_NAME
        if not info.count or kind is None or (kind is Kind.REPORT and topic not in {one.name for one in REPORTS}):
            return
        joints = robot.joint_names if robot is not None and known else ()
        if not joints and kind.has_joints:
            joints = self._names(arm, topic)
        self._add_known(arm, topic, kind, joints, robot if known else None)

    def _names(self, arm: str, topic: str) -> tuple[str, ...]:
        """Names of joints as the first messages of a topic have them."""
        try:
            blocks = (block[topic] for block in self._bags[arm].blocks([topic]) if topic in block)
            return next((series.names for series in blocks), ())
        except TeleopError:
            return ()

    def rows(self, topic: str) -> Rows | None:
        """All rows of a topic; None until they are there. Topics asked for together are read together."""
        with self._lock:
            if topic in self._read:
                return self._read[topic]
            if topic not in self._topics:
                return _NONE
            if len(self._wanted) < _KEPT:
                self._wanted.add(topic)
            if not self._is_reading:
                self._is_reading = True
                threading.Thread(target=self._take, name="console past", daemon=True).start()
            return None

    def _take(self) -> None:
        time.sleep(_GATHER)
        with self._lock:
            wanted, self._wanted = self._wanted, set()
        found = dict.fromkeys(wanted, _NONE)
        try:
            for arm in self._bags:
                own = [self._topics[topic][1] for topic in wanted if self._topics[topic][0] == arm]
                found |= {_below(arm, topic): rows for topic, rows in self._rows_of(arm, own).items()}
        except TeleopError:  # damaged there: nothing can be drawn
            pass
        finally:
            with self._lock:
                self._is_reading = False
                kept = list(self._read.items())[-max(1, 2 * _KEPT - len(found)) :]
                self._read = dict(kept) | found

    def _rows_of(self, arm: str, own: list[str]) -> dict[str, Rows]:
        """Rows of topics of an arm: of streams in one pass."""
        bag, found = self._bags[arm], dict[str, Rows]()
        reports = {one.name for one in REPORTS} & set(own)
        for topic in reports:
            if (series := reports_of(bag, BY_NAME[topic])) is not None:
                found[topic] = self._sorted((series.log_ns - self._start_ns) * 1e-9, series.values)
        known = [topic for topic in own if topic in BY_NAME and topic not in reports]
        foreign = [topic for topic in own if topic not in BY_NAME]
        for streams, joints in ((known, self.joints.get(arm)), (foreign, None)):
            kept = dict[str, Envelope]()
            for block in bag.blocks(streams, joints or None) if streams else ():
                for topic, rows in block.items():
                    if topic not in kept:
                        kept[topic] = Envelope(self._start_ns, self._end_ns, rows.values.shape[1])
                    kept[topic].add(rows.log_ns, rows.values)
            found |= {topic: self._sorted(*one.line()) for topic, one in kept.items()}
        return found

    @staticmethod
    def _sorted(times: Any, values: Any) -> Rows:
        """Rows in the order of their times; those of several writers may stand otherwise."""
        if len(times) and (np.diff(times) < 0.0).any():
            order = np.argsort(times, kind="stable")
            times, values = times[order], values[order]
        return times, values

    def marks(self) -> Sequence[tuple[float, str]]:
        """Times [s] and texts of the marks that somebody set; the first call reads them."""
        if self._marks is None:
            self._marks = tuple(self._marks_of())
        return self._marks

    def _marks_of(self) -> Iterator[tuple[float, str]]:
        for bag in self._bags.values():
            with suppress(TeleopError):  # most have none
                for mark in bag.reports(MARKS):
                    yield (mark.stamp_ns - self._start_ns) * 1e-9, mark.message


def _below(arm: str, topic: str) -> str:
    return f"{arm}/{topic}" if arm else topic


def _values(view: ArmView) -> Iterator[tuple[str, Array]]:
    """What is known of an arm, by topics."""
    yield from view.streams.items()
    if view.state:
        yield TELEOP_STATE.name, np.array([view.state[name] for name in TELEOP_STATE.columns])
    if view.operation:
        yield SLAVE_OPERATION.name, np.array([view.operation[name] for name in OPERATION])


def _of_joints(kind: Kind, count: int, robot: Robot | None) -> list[str]:
    """Units of joints: of position, and where there are, of velocity and effort."""
    joints = count // 3 if kind is Kind.STATE else count
    slides = np.zeros(joints, bool)
    if robot is not None:
        slides = np.linalg.norm(robot.jacobian(robot.home)[3:], axis=0) < 1e-9
    parts = (("m", "rad"), ("m/s", "rad/s"), ("N", "N·m")) if kind is Kind.STATE else (("m", "rad"),)
    return [straight if is_so else turning for straight, turning in parts for is_so in slides.tolist()]
