"""Recorded past: all numbers of a recording over time; each topic is read at its first request."""

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from teleop_console.past import NOTHING, Past, Rows, below
from teleop_console.recorded_arms import namespaces, reports_of
from teleop_core.bags.arms import of_arm
from teleop_core.bags.reader import Bag
from teleop_core.bags.recording import MARKS
from teleop_core.bags.series import kind_of
from teleop_core.base.errors import TeleopError
from teleop_core.evaluation.origin import read_origin
from teleop_core.evaluation.traces import Envelope
from teleop_core.graph import DT
from teleop_core.graph.topics import BY_NAME, REPORTS, Kind
from teleop_core.robots.robot import Robot

_KEPT = 8  # number of topics that are read at the same time; twice this number stays in memory
_GATHER = 0.02  # time within which a page requests all topics that it needs together [s]


class Recorded(Past):
    """All columns of all recorded topics that contain numbers.

    A topic is read at its first request, in a thread: reading ten minutes takes five seconds.
    For recordings longer than eleven minutes, only the smallest and largest value of short intervals are kept.

    Args:
        bag: The recording.
        robots: Robots of the arms by namespace; unknown robots are missing.
    """

    def __init__(self, bag: Bag, robots: Mapping[str, Robot] | None = None) -> None:
        super().__init__()
        robots = robots or {}
        self._start_ns, self._lock = bag.start_ns, threading.Lock()
        self.duration = (bag.end_ns - bag.start_ns) * 1e-9
        self._bags = {name: of_arm(bag, arm) for name, arm in namespaces(bag).items()}
        self.joints = {name: robot.joint_names for name, robot in robots.items()}
        self._end_ns = bag.end_ns
        self._lag = DT * read_origin(bag).lag
        self._marks: tuple[tuple[float, str], ...] | None = None
        self._read: dict[str, Rows] = {}
        self._wanted, self._is_reading = set[str](), False
        self._topics = {below(arm, topic): (arm, topic) for arm, one in self._bags.items() for topic in one.topics}
        for arm, topic in self._topics.values():
            self._note(arm, topic, robots.get(arm))

    def _note(self, arm: str, topic: str, robot: Robot | None) -> None:
        """Add the columns of a topic, if its messages contain numbers."""
        info = self._bags[arm].topics[topic]
        kind, known = kind_of(topic, info.type), topic in BY_NAME
        if not info.count or kind is None or (kind is Kind.REPORT and topic not in {one.name for one in REPORTS}):
            return
        joints = robot.joint_names if robot is not None and known else ()
        if not joints and kind.has_joints:
            joints = self._names(arm, topic)
        self._add_known(arm, topic, kind, joints, robot if known else None)

    def _names(self, arm: str, topic: str) -> tuple[str, ...]:
        """Names of joints, read from the first messages of a topic."""
        try:
            blocks = (block[topic] for block in self._bags[arm].blocks([topic]) if topic in block)
            return next((series.names for series in blocks), ())
        except TeleopError:
            return ()

    def rows(self, topic: str) -> Rows | None:
        """All rows of a topic; None until the topic is read. Topics that are requested together are read together."""
        with self._lock:
            if topic in self._read:
                return self._read[topic]
            if topic not in self._topics:
                return NOTHING
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
        found = dict.fromkeys(wanted, NOTHING)
        try:
            for arm in self._bags:
                own = [self._topics[topic][1] for topic in wanted if self._topics[topic][0] == arm]
                found |= {below(arm, topic): rows for topic, rows in self._rows_of(arm, own).items()}
        except TeleopError:  # a damaged topic cannot be drawn
            pass
        finally:
            with self._lock:
                self._is_reading = False
                kept = list(self._read.items())[-max(1, 2 * _KEPT - len(found)) :]
                self._read = dict(kept) | found

    def _rows_of(self, arm: str, own: list[str]) -> dict[str, Rows]:
        """Rows of topics of an arm; all streams are read in one pass."""
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
        """Sort rows by their times, because rows of several writers may be recorded out of order."""
        if len(times) and (np.diff(times) < 0.0).any():
            order = np.argsort(times, kind="stable")
            times, values = times[order], values[order]
        return times, values

    def marks(self) -> Sequence[tuple[float, str]]:
        """Times [s] and texts of the marks in the recording; the first call reads them."""
        if self._marks is None:
            self._marks = tuple(self._marks_of())
        return self._marks

    def _marks_of(self) -> Iterator[tuple[float, str]]:
        for bag in self._bags.values():
            with suppress(TeleopError):  # most recordings have no marks
                for mark in bag.reports(MARKS):
                    yield (mark.stamp_ns - self._start_ns) * 1e-9, mark.message
