"""Context: the data about a recording that a new metric gets, and the accumulators that metrics share."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Protocol, TypeVar, cast

from teleop_core.bags.kept_files import recorded_files, recorded_geometry
from teleop_core.bags.reader import Bag
from teleop_core.base import EvaluationError, TeleopError, shown
from teleop_core.evaluation.origin import Origin
from teleop_core.evaluation.state_history import StateHistory
from teleop_core.evaluation.windows import Span, Window
from teleop_core.graph.topics import Topic
from teleop_core.robots import load_robot_set
from teleop_core.robots.robot import Robot


class Accumulator(Protocol):
    """Processes a recording window by window."""

    def add(self, window: Window) -> None:
        """Process one window."""


Shared = TypeVar("Shared", bound=Accumulator)


class Context:
    """One arm of one recording.

    Attributes:
        bag: The recording; it contains only this arm, and its topics have plain names.
        arm: Name of the arm; empty for the default arm of a recording that names no arms.
        history: Values of ``teleop/state`` over time.
        origin: The session that was recorded: graph, streams, chain of stages, map of axes.
        robot: Name of the robot; None if unknown.
        span: Scored part of the recording; None for the whole recording.
    """

    def __init__(self, bag: Bag, arm: str, history: StateHistory, origin: Origin, span: Span | None = None) -> None:
        self.bag, self.arm, self.history, self.origin = bag, arm, history, origin
        self.span = span
        self.robot = bag.metadata.get("robot") or None
        self._read: dict[str, Topic] = {}
        self._parts: dict[Callable[[Context], Accumulator], Accumulator] = {}
        self._has_begun = False

    def load_robot(self) -> Robot | None:
        """The robot as it was recorded; None if the recording does not name a robot, or the robot is not installed."""
        if self.robot is not None:
            with suppress(TeleopError, OSError):
                files = recorded_files(self.bag.metadata)
                geometry = recorded_geometry(self.origin.geometry, files)
                return load_robot_set(files.get(self.robot, self.robot), geometry)
        return None

    def missing(self) -> tuple[str, ...]:
        """Parts that the recording names but that are not installed, each as a text."""
        is_lost = self.robot is not None and self.load_robot() is None
        return (*self.origin.missing, *[f"robot {shown(self.robot)}"] * is_lost)

    def expected(self, topic: Topic) -> int:
        """Number of messages of a topic in the recording."""
        info = self.bag.topics.get(topic.name)
        return 0 if info is None else info.count

    def read(self, topics: Iterable[Topic]) -> None:
        """Request streams that depend on the recording, in addition to the streams that metrics declare.

        Streams that the recording lacks have no samples.

        Args:
            topics: Streams, with their plain names.

        Raises:
            EvaluationError: The recording is already being read; streams must be requested while a metric is
                constructed.
        """
        for topic in topics:
            if self._has_begun:
                raise EvaluationError(f"{topic.name} is requested too late, must be requested in __init__")
            if self.expected(topic):
                self._read.setdefault(topic.name, topic)

    @property
    def topics(self) -> list[Topic]:
        """Streams that the windows contain: all streams that were requested and recorded."""
        return list(self._read.values())

    def shared(self, kind: Callable[["Context"], Shared]) -> Shared:
        """The accumulator of one kind that all metrics of a score share; it may be a metric itself.

        The accumulator is constructed at the first request. It gets every window once, before the metrics that
        requested it.

        Args:
            kind: Class of the accumulator, or another function that constructs it.

        Raises:
            EvaluationError: The accumulator would miss windows; it must be requested while a metric is constructed.
        """
        if kind not in self._parts:
            if self._has_begun:
                name = getattr(kind, "__name__", str(kind))
                raise EvaluationError(f"{name} is requested too late, must be requested in __init__")
            self._parts[kind] = kind(self)
        return cast(Shared, self._parts[kind])

    def begin(self) -> list[Accumulator]:
        """All accumulators in the order in which they process windows. No accumulators can be added after this call."""
        self._has_begun = True
        return list(self._parts.values())
