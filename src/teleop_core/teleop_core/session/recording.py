"""Recording: a session as arrays, by topic and column name, in memory or on disk."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import layouts, memory, reader, recording
from teleop_core.bags.arms import arm_names, topic_prefix
from teleop_core.bags.series import Series, kind_of
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import RecordingError, TeleopError, UnknownNameError
from teleop_core.graph.topics import BY_NAME, MASTER_MEASURED_CP, SLAVE_MEASURED_JS, Kind
from teleop_core.kernels.geometry import Array

if TYPE_CHECKING:
    import pandas

    from teleop_core.evaluation import Metric, Score
    from teleop_core.session.model import Model

__all__ = ["Recording", "Stream", "open_recording"]


@dataclass(frozen=True, eq=False)
class Stream:
    """All messages of one topic.

    Attributes:
        topic: Name of the topic.
        columns: Names of the columns: ``x y z qw qx qy qz`` of a pose, ``fx`` of a force, the joints' names,
            ``<joint>.velocity`` of a joint state, the fields of ``teleop/state``.
        stamp_ns: Stamps of the headers (N,) [ns].
        log_ns: Times of recording (N,) [ns].
        values: Rows (N, columns) in SI units.
        start_ns: Start time of the recording [ns].
    """

    topic: str
    columns: tuple[str, ...]
    stamp_ns: NDArray[np.int64]
    log_ns: NDArray[np.int64]
    values: Array
    start_ns: int

    @property
    def time(self) -> Array:
        """Times of recording (N,) [s] since the recording began."""
        return np.asarray((self.log_ns - self.start_ns) * 1e-9, dtype=np.float64)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def __getitem__(self, column: str | Sequence[str]) -> Array:
        """One column (N,) by its name, or several columns (N, k) by a list of names.

        Raises:
            UnknownNameError: There is no such column; the error lists the alternatives.
        """
        if isinstance(column, str):
            found: Array = self.values[:, self._index(column)]
            return found
        several: Array = self.values[:, [self._index(name) for name in column]]
        return several

    def _index(self, column: str) -> int:
        if column not in self.columns:
            raise UnknownNameError(f"column of {self.topic}", column, self.columns)
        return self.columns.index(column)

    def part(self, rows: slice) -> "Stream":
        """Stream with the selected messages only."""
        stamp_ns, log_ns = self.stamp_ns[rows], self.log_ns[rows]
        values = self.values[rows]
        return Stream(self.topic, self.columns, stamp_ns, log_ns, values, self.start_ns)

    def frame(self) -> "pandas.DataFrame":
        """The stream as a pandas data frame, indexed by time [s], with a column of stamps."""
        import pandas

        frame = pandas.DataFrame(self.values, columns=list(self.columns))
        frame.insert(0, "stamp_ns", self.stamp_ns)
        frame.index = pandas.Index(self.time, name="time")
        return frame

    def __repr__(self) -> str:
        return f"Stream({self.topic}: {len(self)} × {', '.join(self.columns)})"


class Recording:
    """A recorded session: its topics as arrays, its metadata and its scores.

    Topics are named as in ROS, without a leading slash. Topics of a further arm begin with the arm's name:
    ``recording["left/slave/measured_cp"]``.

    Args:
        bag: The recording, in memory or on disk.
    """

    def __init__(self, bag: reader.Bag) -> None:
        self._bag = bag

    @property
    def bag(self) -> reader.Bag:
        """The recording message by message, for replay and for tools."""
        return self._bag

    @property
    def path(self) -> Path | None:
        """Path of the recording on disk; None if it is in memory."""
        return None if isinstance(self._bag, memory.MemoryBag) else self._bag.path

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics with at least one message."""
        return tuple(name for name, info in self._bag.topics.items() if info.count)

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms, the default arm first; ``("",)`` if the only arm has no name."""
        return arm_names(self._bag)

    @property
    def metadata(self) -> dict[str, str]:
        """Texts stored with the recording: version, scenario, robot, seed, configuration."""
        return dict(self._bag.metadata)

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s].

        This is longer than the ``duration`` of :func:`teleop_core.run`: the slave first moves to its start, and
        ``duration`` is counted from the time at which the hand may begin to move.
        """
        return (self._bag.end_ns - self._bag.start_ns) * 1e-9

    def __getitem__(self, topic: str) -> Stream:
        """All messages of a topic.

        Raises:
            UnknownNameError: There is no such topic; the error lists the alternatives.
            RecordingError: The topic cannot be read as numbers, or the file is damaged.
        """
        name = topic.removeprefix("/")
        if name not in self.topics:
            raise UnknownNameError("topic", name, self.topics)
        kind = kind_of(name, self._bag.topics[name].type)
        if kind is Kind.REPORT:
            return self._reports(name)
        series = self._bag.read(name)
        return self._stream(name, series, _columns(kind, series))

    def __iter__(self) -> Iterator[str]:
        return iter(self.topics)

    def __contains__(self, topic: object) -> bool:
        return isinstance(topic, str) and topic.removeprefix("/") in self.topics

    def _stream(self, name: str, series: Series, columns: tuple[str, ...]) -> Stream:
        start_ns = self._bag.start_ns
        return Stream(name, columns, series.stamp_ns, series.log_ns, series.values, start_ns)

    def _reports(self, name: str) -> Stream:
        """Stream of the numbers in a topic's reports, with one row per message."""
        plain = next((t for n, t in BY_NAME.items() if name == n or name.endswith(f"/{n}")), None)
        columns = plain.columns if plain is not None else ()
        if not columns:
            raise RecordingError(self._bag.path, f"{name} contains texts, which cannot be read as columns")
        reports = self._bag.reports(name)
        rows = [[float(report.values.get(c, "nan")) for c in columns] for report in reports]
        stamps = np.array([report.stamp_ns for report in reports], np.int64)
        series = Series(stamps, stamps, np.array(rows, np.float64).reshape(-1, len(columns)))
        return self._stream(name, series, columns)

    def frame(self, *topics: str) -> "pandas.DataFrame":
        """Some topics side by side over the time [s], each column as ``topic.column``.

        Args:
            *topics: Names of the topics; all streams of numbers if none is given. There is one row for each time at
                which any of them has a message; columns of topics without a message at that time are NaN.

        Raises:
            UnknownNameError: There is no such topic.
        """
        names = topics or tuple(
            name for name in self.topics if kind_of(name, self._bag.topics[name].type) not in {None, Kind.REPORT}
        )
        frames = []
        for name in names:
            frame = self[name].frame().drop(columns="stamp_ns").add_prefix(f"{name}.")
            frames.append(frame[~frame.index.duplicated(keep="last")])
        import pandas

        return pandas.concat(frames, axis=1)

    def score(
        self, arm: str = "", further: "Sequence[type[Metric]]" = (), span: tuple[float, float] | None = None
    ) -> "Score":
        """Score of one arm.

        Args:
            arm: Name of the arm; empty for the default arm.
            further: Metrics in addition to the registered metrics.
            span: Begin and end [s] of the scored part, since the first message; None for the whole recording.

        Raises:
            TeleopError: Nothing can be scored; the error text gives the reason.
        """
        from teleop_core.evaluation import evaluate

        return evaluate(self._bag, arm, further, span)

    def scores(self, further: "Sequence[type[Metric]]" = (), span: tuple[float, float] | None = None) -> "list[Score]":
        """Scores of all arms, the default arm first; see :meth:`score`."""
        from teleop_core.evaluation import scores

        return scores(self._bag, further, span)

    def save(self, path: Path | str) -> "Recording":
        """Write the recording to a new directory, in the format of ``ros2 bag``.

        Returns:
            The written recording.

        Raises:
            RecordingError: The directory exists or cannot be written.
        """
        if not isinstance(self._bag, memory.MemoryBag):
            return self._copied(Path(path))
        bag = self._bag
        from teleop_core.session.model import write_model_of

        names = {t.arm: found.names for t, found in bag.streams.items() if t.kind.has_joints}
        reports = [t for t in BY_NAME.values() if t.kind is Kind.REPORT]
        reports = [t.of_arm(arm) for arm in ("", *self.arms[1:]) for t in reports]
        topics = [*bag.streams, *(t for t in reports if t.name in bag.topics)]
        model = _model_of(bag)
        with BagWriter(
            path, (*topics, *model.topics), names, parameters=recording.RecordingParameters(), metadata=bag.metadata
        ) as writer:
            for begin, end in _seconds(bag.start_ns, [s.log_ns for s in bag.streams.values()]):
                writer.write_block({t: _between(s, begin, end) for t, s in bag.streams.items()})
            for topic in topics[len(bag.streams) :]:
                for _, _, log_ns, data in bag.raw([topic]):
                    writer.write(topic, log_ns, data)
            write_model_of(bag, model, writer)
        return open_recording(path)

    def _copied(self, path: Path) -> "Recording":
        try:
            shutil.copytree(self._bag.path, path)
        except FileExistsError as error:
            raise RecordingError(path, "exists already; choose another path") from error
        except OSError as error:
            raise RecordingError(path, f"cannot be written: {error.strerror}") from error
        return open_recording(path)

    def __repr__(self) -> str:
        about = self._bag.metadata
        facts = [about.get("scenario") or self._bag.path.name, about.get("robot", "")]
        if self.arms != ("",):
            facts.append("arms " + ", ".join(self.arms))
        where = "in memory" if self.path is None else str(self.path)
        known = ", ".join(fact for fact in facts if fact)
        return f"Recording({known}, {self.duration:.3g} s, {len(self.topics)} topics, {where})"

    def _repr_html_(self) -> str:
        from teleop_core.evaluation.sketch import sketch

        paths = {}
        for arm in self.arms:
            prefix = topic_prefix(self._bag, arm)
            with suppress(TeleopError):
                wanted, reached = (self[f"{prefix}slave/{name}_cp"] for name in ("setpoint", "measured"))
                paths[arm] = wanted[["x", "y", "z"]], reached[["x", "y", "z"]]
        return sketch(repr(self), paths)


def _model_of(bag: reader.Bag) -> "Model":
    """Robots of a recording, from the configuration stored in it; no robots for recordings of other writers."""
    from teleop_core.session.configuration import Configuration
    from teleop_core.session.model import Model
    from teleop_core.session.runner import recorded_configuration

    needed = {SLAVE_MEASURED_JS.name, MASTER_MEASURED_CP.name}
    is_ours = "configuration" in bag.metadata and needed <= set(bag.topics)
    try:
        layer, scenario = recorded_configuration(bag)
        return Model(Configuration.from_layers([layer], scenario), None if is_ours else 0.0)
    except TeleopError:  # made with parts that are not installed: the numbers can be read, but nothing can be drawn
        return Model(Configuration.from_layers([]), 0.0)


def _columns(kind: Kind | None, series: Series) -> tuple[str, ...]:
    width = series.values.shape[1]
    if kind is not None and kind.has_joints:
        kind = Kind.JOINTS if width == len(series.names) else Kind.STATE
    assert kind is not None
    return kind.columns(series.names)


def _seconds(start_ns: int, logs: list[NDArray[np.int64]]) -> list[tuple[int, int]]:
    """Begin and end [ns] of every second since the start in which something was recorded."""
    found = np.unique(np.concatenate([(log_ns - start_ns) // layouts.SECOND_NS for log_ns in logs]))
    begins = [start_ns + second * layouts.SECOND_NS for second in found.tolist()]
    return [(begin, begin + layouts.SECOND_NS) for begin in begins]


def _between(series: Series, begin_ns: int, end_ns: int) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Stamps, values and log times of the part of a stream that was recorded between two times."""
    first, last = np.searchsorted(series.log_ns, (begin_ns, end_ns))
    part = slice(int(first), int(last))
    return series.stamp_ns[part], series.values[part], series.log_ns[part]


def open_recording(path: Path | str) -> Recording:
    """Open a recording made by this package or by others.

    Args:
        path: Directory of the recording, or one ``.mcap`` file.

    Raises:
        RecordingError: The path does not exist or is no recording, or the recording was cut off or is empty.
    """
    return Recording(reader.Bag(path))
