"""Counts: scored samples, ticks, messages, and the counts of the nodes of a live session."""

from dataclasses import dataclass

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.evaluation import MISSING, TRACKED, Context, Key, Metric, TableRow, Window, keys_of, tracked
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.graph.signals import PHASES
from teleop_core.graph.topics import DIAGNOSTICS, SLAVE_MEASURED_CP

Counts = dict[str, dict[str, int]]


class NodesMetric(Metric):
    """Last reported counts of each node; empty in virtual time, where nodes do not report."""

    name = "nodes"
    keys = (Key("nodes.<node>.<name>", "1", "last values of the counters that the node reported on diagnostics"),)

    def __init__(self, context: Context) -> None:
        self._counts = _read_counts(context.bag)

    def add(self, window: Window) -> None:
        """Do nothing: reports are not streams."""

    def values(self) -> Counts:
        """Counts per node and name."""
        return self._counts


def _read_counts(bag: Bag) -> Counts:
    """Counts per node and name; empty without diagnostics."""
    counts: Counts = {}
    info = bag.topics.get(DIAGNOSTICS.name)
    for report in bag.reports(DIAGNOSTICS) if info is not None and info.count else ():
        found = {key: int(text) for key, text in report.values.items() if _is_whole(text)}
        counts.setdefault(report.name.strip("/"), {}).update(found)
    return counts


def _is_whole(text: str) -> bool:
    return text.isascii() and text.removeprefix("-").isdigit()


GROUP = "counts"
_FORMER = "slave_sim"  # the node that counted the ticks in versions without an arm server


@dataclass(frozen=True)
class Ticks:
    """Control ticks of the slave.

    Attributes:
        executed: Ticks executed.
        late: Ticks that began late; None if they were not counted (virtual time, foreign slaves).
        made_up: Ticks executed after the next tick was due; None if they were not counted.
        dropped: Ticks that were due but never executed.
        gave_way: How often the loop gave up its real-time priority because it could not keep up; None if that was not
            counted.
    """

    executed: int
    late: int | None
    made_up: int | None
    dropped: int
    gave_way: int | None = None


class TicksMetric(Metric):
    """Counts of ticks, taken from the slave's own report if there is one, otherwise from the slave's samples."""

    name = "ticks"
    keys = (
        Key(
            "ticks.executed|late|made_up|dropped|gave_way",
            "1",
            "control ticks of the slave: executed: all; late: begun late; made_up: executed after "
            "the next tick was due; dropped: never executed; gave_way: how often the loop gave up its real-time "
            "priority because it could not keep up; late, made_up and gave_way are null if nobody counted them",
        ),
    )
    topics = (SLAVE_MEASURED_CP,)

    def __init__(self, context: Context) -> None:
        self._nodes, self._stamps = context.shared(NodesMetric), context.shared(StampTallies)
        self._samples = context.expected(SLAVE_MEASURED_CP)
        self._slave = context.origin.writer(SLAVE_MEASURED_CP)

    def add(self, window: Window) -> None:
        """Do nothing: other accumulators count stamps and reports."""

    def values(self) -> Ticks:
        """Ticks of the whole recording."""
        own = self._own()
        gaps = self._stamps.of[SLAVE_MEASURED_CP.name].gaps()
        missed, made_up = own.get("missed"), own.get("caught_up")
        dropped = gaps if missed is None else missed - (made_up or 0)
        return Ticks(own.get("ticks", self._samples), own.get("late"), made_up, dropped, own.get("gave_way"))

    def _own(self) -> dict[str, int]:
        """Counts that the slave's node reported."""
        nodes = self._nodes.values()
        return nodes.get(self._slave) or nodes.get(_FORMER) or {}

    def rows(self) -> list[TableRow]:
        """Rows for ticks, for each kind of tick that was not in time, and for the time of a live tick's phases."""
        ticks = self.values()
        late, made_up = (MISSING if n is None else str(n) for n in (ticks.late, ticks.made_up))
        rows = [
            TableRow(GROUP, "ticks executed", "", str(ticks.executed)),
            TableRow(GROUP, "late/made up/dropped", "", f"{late}/{made_up}/{ticks.dropped}"),
        ]
        own = self._own()
        if count := own.get("phase_ticks"):
            times = "/".join(f"{own.get(f'phase_us.{name}', 0) / count:.0f}" for name in PHASES)
            rows.append(TableRow(GROUP, f"a tick: {'/'.join(PHASES)}", "µs", times))
        if ticks.gave_way:
            rows.append(TableRow(GROUP, "gave up priority", "", f"{ticks.gave_way} times"))
        return rows


@dataclass(frozen=True)
class TopicScore:
    """Messages of a topic.

    Attributes:
        count: Number of recorded messages.
        gaps: Number of missing messages, found by the stamps; None if the topic is not a stream.
        lost: Number of the missing messages that were sent but lost on the way to the recorder; None if they were not
            counted. The other missing messages were never sent, because a stage processes only the newest sample.
    """

    count: int
    gaps: int | None
    lost: int | None


class TopicsMetric(Metric):
    """Counts and gaps of all recorded topics."""

    name = "topics"
    keys = (
        Key("topics.<name>.count", "1", "messages"),
        Key(
            "topics.<name>.gaps",
            "1",
            "missing messages, found by gaps between the stamps: lost, or skipped by a stage that "
            "takes only the newest. A gap counts at the topic where it begins, and does not count in "
            "a replayed file. Null for topics that are no streams, are sent only on changes, or came "
            "through a simulated network, which loses packets on purpose",
        ),
        Key(
            "topics.<name>.lost",
            "1",
            "messages that were sent but did not reach the recorder, by the recorder's count; null "
            "if it did not count them",
        ),
    )

    def __init__(self, context: Context) -> None:
        self._infos, self._stamps = context.bag.topics, context.shared(StampTallies)
        self._nodes = context.shared(NodesMetric)

    def add(self, window: Window) -> None:
        """Do nothing: another accumulator counts the stamps."""

    def values(self) -> dict[str, TopicScore]:
        """Score of each topic, in the order of their names."""
        return {
            name: TopicScore(info.count, self._gaps(name), self._lost(name))
            for name, info in sorted(self._infos.items())
        }

    def _lost(self, name: str) -> int | None:
        reports = self._nodes.values().items()
        told = (counts for node, counts in reports if node.rpartition("/")[2] == RECORDER_NAME)
        return next((counts[key] for counts in told if (key := f"lost.{name}") in counts), None)

    def _gaps(self, name: str) -> int | None:
        tally = self._stamps.of.get(name)
        if tally is None or tally.topic.is_seldom or tally.topic.stamp.may_skip:
            return None
        return tally.gaps()

    def rows(self) -> list[TableRow]:
        """Sums over all topics."""
        topics = self.values().values()
        return [
            TableRow(GROUP, "messages", "", str(sum(topic.count for topic in topics))),
            TableRow(GROUP, "messages missing", "", str(sum(topic.gaps or 0 for topic in topics))),
            TableRow(GROUP, "lost on the way", "", str(sum(topic.lost or 0 for topic in topics))),
        ]


@dataclass(frozen=True)
class Samples:
    """Number of scored slave poses, and of poses that were not scored, by reason."""

    scored: int = figure("1", "number of slave poses whose reference of the same tick was recorded")
    unpaired: int = figure("1", "number of slave poses whose reference was lost before the recorder")
    invalid: int = figure("1", "number of slave poses or references with NaN or a zero quaternion")


class SamplesMetric(Metric):
    """Counts the poses from which the errors are computed."""

    name = "samples"
    keys = keys_of("samples", Samples)
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._scored = self._unpaired = self._invalid = 0

    def add(self, window: Window) -> None:
        """Process one window."""
        found = tracked(window)
        has_angle = np.isfinite(found.against.angle_deg)
        is_valid = np.isfinite(found.against.position_mm) & has_angle
        self._scored += int(has_angle.sum())
        self._unpaired += int((~found.is_paired).sum())
        self._invalid += int((~is_valid & found.is_paired).sum())

    def values(self) -> Samples:
        """Counts so far."""
        return Samples(self._scored, self._unpaired, self._invalid)

    def rows(self) -> list[TableRow]:
        """No rows: tables show counts of messages and ticks only."""
        return []
