"""Runner: a session in virtual time, recorded block by block, and its replay."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import kept_files
from teleop_core.bags.arms import ARMS_KEY, PLAYED_KEY
from teleop_core.bags.reader import Bag, Series
from teleop_core.bags.writer import BagWriter
from teleop_core.base import RecordingError
from teleop_core.graph import RECORDER_NAME, SESSION, TICK_NS, Layer, Member, topics
from teleop_core.graph.former_shapes import present_layer
from teleop_core.graph.graph import DEVICE
from teleop_core.graph.layers import parse_text
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot_set
from teleop_core.session import replayed_span, virtual
from teleop_core.session.configuration import Configuration
from teleop_core.session.model import Model, ModelRecords
from teleop_core.session.reports import report_of
from teleop_core.shapes import files_of, moved

Progress = Callable[[int, int], None]
_OVER = topics.TASK_STATE.columns.index("is_over")


def silent(*_: object) -> None:
    """Show no progress."""


def simulate(configuration: Configuration, out: Path, progress: Progress = silent) -> int:
    """Run a session in virtual time and record it.

    Args:
        configuration: Configuration of the session.
        out: Directory of the recording, which is created.
        progress: Called after every simulated second with the number of finished ticks and the total number of ticks.

    Returns:
        Number of ticks.

    Raises:
        RecordingError: The directory exists, cannot be written, or the disk is full.
    """
    session = virtual.VirtualTime(configuration)
    ticks = session_ticks(configuration, session)
    return record_blocks(session, configuration, out, run_blocks(session, ticks), ticks, progress)


def session_ticks(configuration: Configuration, session: virtual.VirtualTime) -> int:
    """Number of ticks until the hand has moved for the configured duration. The hand first waits for the arms."""
    return session.lead + max(1, round(configuration.session.duration * 1e9 / TICK_NS))


def run_blocks(session: virtual.VirtualTime, ticks: int) -> Iterator[Any]:
    """Rows of the next ticks, block by block. Each block overwrites the block before it.

    With ``teleop.ends_with_task`` the session ends after the first block at whose end no task has a goal left.
    """
    rows = session.rows(min(virtual.BLOCK, ticks))
    tasks = [t.field for t in session.graph.streams if t == topics.TASK_STATE.of_arm(t.arm)]
    may_end = session.configuration.session.ends_with_task and bool(tasks)
    for done in range(0, ticks, virtual.BLOCK):
        count = min(virtual.BLOCK, ticks - done)
        block = session.run(count, rows[:count])
        yield block
        if may_end and all(block[field][-1, _OVER] > 0.0 for field in tasks):
            return


def replay(bag: Bag, configuration: Configuration, out: Path, progress: Progress = silent, begin: str = DEVICE) -> int:
    """Run recorded masters, or hands, through the graph again in virtual time, and record the result.

    Ticks are 1 ms apart, from the first to the last recorded sample. Each sample is processed once, at the first tick
    that is not before it. In a recording of virtual time every tick has its own sample, so the same configuration
    gives exactly the same slave motion, bit for bit. If the recording is from another writer, or its hand did not wait
    long enough, the replay begins with the time that the arms need to get ready.

    Args:
        bag: Recording with master/measured_cp of every arm, or hand/servo_cp.
        configuration: Configuration of the session that processes the samples.
        out: Directory of the new recording, which is created.
        progress: As in :func:`simulate`.
        begin: Stage whose recorded output is played: ``haptic_master`` is the device, ``operator`` is the hand.

    Returns:
        Number of ticks.

    Raises:
        RecordingError: The bag lacks a topic, or the directory exists or cannot be written.
    """
    session = virtual.VirtualTime(configuration, played=begin)
    samples, ticks = replayed_blocks(session, bag)
    return record_blocks(session, configuration, out, samples, ticks, progress)


def replayed_blocks(session: virtual.VirtualTime, bag: Bag) -> tuple[Iterator[Any], int]:
    """Rows of a replay, block by block, and the number of ticks. Raises the same errors as :func:`replay`."""
    played = session.played_topics
    needed = session.needed_topics
    bag.require(needed)
    session.plays_file = PLAYED_KEY in bag.metadata or not bag.metadata.get("configuration")
    recorded = [t for t in played if t.name in bag.topics and bag.topics[t.name].count]
    series = {name: replayed_span.in_order(found) for name, found in bag.read_many(recorded).items()}
    name = needed[0].name
    first_ns, last_ns = replayed_span.replayed_span(bag.path, name, series[name].stamp_ns)
    lead_ns = _lead_ns(session, bag, first_ns)
    later_ns = max(0, TICK_NS + lead_ns - first_ns)  # this shift keeps all stamps positive
    # The last tick is the first one that is not before the last sample.
    begin_ns = first_ns + later_ns - lead_ns
    ticks = -(-(last_ns + later_ns + TICK_NS - begin_ns) // TICK_NS)

    def blocks() -> Iterator[Any]:
        for done in range(0, ticks, virtual.BLOCK):
            samples = session.rows(min(virtual.BLOCK, ticks - done))
            samples["now_ns"] = replayed_span.tick_times(begin_ns + done * TICK_NS, len(samples))
            for topic in recorded:
                _hold(series[topic.name], later_ns, samples, topic.field)
            yield session.replay(samples)

    return blocks(), ticks


def _lead_ns(session: virtual.VirtualTime, bag: Bag, first_ns: int) -> int:
    """Time [ns] that the arms still need before the first sample; 0 if the recorded hand waited long enough."""
    lead_ns = session.lead * TICK_NS
    states = [topics.TELEOP_STATE.of_arm(arm) for arm in session.graph.namespaces]
    is_known = all(state.name in bag.topics for state in states)
    if not lead_ns or "configuration" not in bag.metadata or not is_known:
        return lead_ns
    begins = [_follows_ns(bag, state) for state in states]  # an arm near its start begins to follow early
    return lead_ns if None in begins else max(0, lead_ns - (max(filter(None, begins)) - first_ns))


def _follows_ns(bag: Bag, state: topics.Topic) -> int | None:
    """Time at which an arm began to follow its hand [ns]; None if it never followed."""
    told = (r.stamp_ns for r in bag.reports(state) if r.values.get("is_following") == "1.0")
    return min(told, default=None)


def _hold(series: Series, later_ns: int, samples: Any, field: str) -> None:
    """Write the newest recorded sample and its stamp into ``samples`` at each tick.

    Ticks before the first sample are not changed.
    """
    stamps = series.stamp_ns + later_ns
    at = np.searchsorted(stamps, samples["now_ns"], side="right") - 1
    is_known = at >= 0
    samples[field][is_known] = series.values[at[is_known]]
    samples[f"{field}_ns"][is_known] = stamps[at[is_known]]


def recorded_configuration(bag: Bag) -> tuple[Layer, str]:
    """Configuration and scenario that a recording was made with; both empty for bags of other writers.

    Files of a robot, its drives, a mesh and a height field are read as they were recorded, see
    :mod:`teleop_core.bags.kept_files`.

    Raises:
        TeleopError: The stored configuration is invalid.
    """
    text, arms = bag.metadata.get("configuration"), bag.metadata.get(ARMS_KEY, "").split()
    layer = present_layer(parse_text(text, f"{bag.path}: configuration")) if text else {}
    if arms and not text:  # the bag is an import of several hands
        layer = {SESSION: {"arms": tuple(arms)}}
    owners = {name: name.rpartition("/")[0] for name in layer}
    found = {arm: kept_files.recorded_files(bag.metadata, arm) for arm in set(owners.values())}
    for name, values in layer.items():
        files = found[owners[name]]
        for key, value in values.items():
            if key == "robot" or key.endswith((".file", ".parts")):
                values[key] = moved(value, files)
        if isinstance(geometry := values.get("geometry"), tuple | list):
            values["geometry"] = kept_files.recorded_geometry(map(str, geometry), files)
    _begin_at_home(layer)
    return layer, bag.metadata.get("scenario", "")


def _begin_at_home(layer: Layer) -> None:
    """Let slaves of old recordings begin at home. Old versions had no parameter ``start``."""
    for name, values in layer.items():
        is_old = name.rpartition("/")[2] == "slave" and "start" not in values
        if is_old and isinstance(robot := values.get("robot"), str):
            geometry = values.get("geometry", ())
            settings = geometry if isinstance(geometry, tuple | list) else ()
            values["start"] = tuple(load_robot_set(robot, map(str, settings)).home.tolist())


def record_blocks(
    session: virtual.VirtualTime,
    configuration: Configuration,
    out: Path,
    blocks: Iterable[Any],
    ticks: int,
    progress: Progress = silent,
) -> int:
    """Record blocks of rows while the session makes them.

    Args:
        session: Session that makes the blocks.
        configuration: Configuration that is stored in the recording.
        out: Directory of the recording, which is created.
        blocks: Rows of the session.
        ticks: Total number of ticks, for the progress.
        progress: Called with the number of finished ticks and the total number of ticks.

    Returns:
        Number of ticks.

    Raises:
        RecordingError: The directory exists or cannot be written, or there are no ticks.
    """
    done, model = 0, Model(configuration)
    with open_writer(session, configuration, out, model.topics) as writer:
        reports, is_new, models = StateReports(session), NewSamples(), ModelRecords(model)
        for block in blocks:
            log_ns = block["now_ns"]
            writer.write_block({t: is_new.of(t, block, log_ns) for t in session.graph.streams})
            reports.write(writer, block)
            models.write(writer, block)
            done += len(block)
            progress(done, ticks)
    if not done:
        raise RecordingError(out, "holds no ticks")
    return done


def open_writer(
    session: virtual.VirtualTime, configuration: Configuration, out: Path, further: tuple[topics.Topic, ...] = ()
) -> BagWriter:
    """Writer for all topics of a session's stages, and for further topics."""
    return BagWriter(
        out,
        (*session.graph.topics, *further),
        session.joint_names,
        parameters=configuration.groups[RECORDER_NAME],
        metadata=describe(configuration) | session.about,
    )


def describe(configuration: Configuration) -> dict[str, str]:
    """Names and texts stored with a recording, so that it can be repeated."""
    from teleop_core import __version__

    graph, files = configuration.graph, kept_files.KeptFiles()
    prefixes = {arm: f"{arm}/" if arm else "" for arm in graph.namespaces}
    about = {"version": __version__, "scenario": configuration.scenario}
    if graph.arms != ("",):
        about["arms"] = " ".join(graph.arms)
    for arm, prefix in prefixes.items():  # store these files before the robots' meshes, which are only drawn
        for name, kind in (("world", kept_files.TOUCHED), ("fixture", kept_files.FIXTURE)):
            part = configuration.value(name, arm)
            for place, file in enumerate(files_of(part.kind.parameters) if part else ()):
                files.add_mesh(file, prefix, f"{kind}{place or ''}")
    for arm, prefix in prefixes.items():
        about |= {f"{prefix}{n}": str(configuration.value(n, arm)) for n in ("robot", "seed")}
        geometry = configuration.value("geometry", arm) or ()
        files.add_robot(about[f"{prefix}robot"], geometry, prefix)
    return about | files.texts() | {"configuration": configuration.text()}


class NewSamples:
    """Finds the rows of a session that contain a new message.

    A stage that is triggered by a slow master writes one message per sample, not one per tick. Topics whose stamp the
    writer itself sets (``is_in_force``) have a message in every tick.
    """

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self._values: dict[str, Array] = {}
        self._periods: dict[str, int] = {}

    def of(
        self, topic: topics.Topic, block: Any, log_ns: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
        """Stamps (N,), values (N, width) and log times (N,) of the messages in the next rows."""
        stamps, values = block[f"{topic.field}_ns"], block[topic.field]
        if topic.stamp.is_in_force:
            return stamps, values, log_ns
        is_new = np.empty(len(stamps), np.bool_)
        is_new[0] = stamps[0] != self._last.get(topic.name, 0)
        np.not_equal(stamps[1:], stamps[:-1], out=is_new[1:])
        self._last[topic.name] = int(stamps[-1])
        if topic.is_seldom:
            is_new &= self._is_due(topic, values, stamps)
        if is_new.all():
            return stamps, values, log_ns
        return stamps[is_new], values[is_new], log_ns[is_new]

    def _is_due(self, topic: topics.Topic, values: Array, stamps: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (N,) of the recorded rows of a seldom topic: rows that change, and the first row of each period."""
        before = self._values.get(topic.name, np.full((1, values.shape[1]), np.nan))
        self._values[topic.name] = values[-1:].copy()
        changes = (np.concatenate((before, values[:-1])) != values).any(axis=1)
        # Stamps of a live session are not multiples of the period.
        periods = stamps // topics.SELDOM_NS
        last = self._periods.get(topic.name, int(periods[0]))
        self._periods[topic.name] = int(periods[-1])
        due: NDArray[np.bool_] = changes | (np.diff(periods, prepend=last) != 0)
        return due


class ReportWriter(Protocol):
    """Writer of single messages."""

    def write(self, topic: topics.Topic, log_ns: int, data: bytes) -> None:
        """Write one message."""


class StateReports:
    """Records the reports of a session's stages whenever they change."""

    def __init__(self, session: virtual.VirtualTime) -> None:
        self._reports = [
            _Report(session, member, topic)
            for member in session.graph.members
            for topic in member.writes
            if topic.kind is topics.Kind.REPORT
        ]

    def write(self, writer: ReportWriter, block: Any) -> None:
        """Record the changes of a block."""
        for one in self._reports:
            one.write(writer, block)


class _Report:
    def __init__(self, session: virtual.VirtualTime, member: Member, topic: topics.Topic) -> None:
        self._topic, self._stage = topic, session.stages.get(member.name)
        self._last = np.full(len(topic.columns), np.nan)

    def write(self, writer: ReportWriter, block: Any) -> None:
        states, stamps = block[self._topic.field], block[f"{self._topic.field}_ns"]
        changed = (states != np.vstack((self._last, states[:-1]))).any(axis=1)
        described = self._stage.described() if self._stage is not None else {}
        for i in np.flatnonzero(changed):
            data = report_of(self._topic, int(stamps[i]), states[i], described)
            writer.write(self._topic, int(block["now_ns"][i]), data)
        self._last = np.array(states[-1])
