"""Compose: the tick of a graph as a program of copies and calls.

In each tick the program copies values from record to record along the links and calls the kernel of each stage. It
stamps the topics that the stage wrote and copies them to the row that is recorded. One compiled loop runs the
programs of all graphs (:mod:`teleop_core.kernels.program`).
"""

import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from teleop_core import kernels
from teleop_core.base.errors import PartError, TeleopError
from teleop_core.graph.graph import Graph, Link, Member
from teleop_core.graph.signals import add, topic_fields
from teleop_core.graph.stage import Runner
from teleop_core.kernels.fields import Integers
from teleop_core.kernels.program import Program

__all__ = ["Tick", "block_dtype", "compose"]


def block_dtype(graph: Graph, joints: Mapping[str, int]) -> Any:
    """NumPy record type of all data of a tick: ``now_ns``, all topics with stamps, and the stages' notes.

    Args:
        graph: The graph.
        joints: Number of joints of each arm, by its namespace.
    """
    fields: list[Any] = [("now_ns", "i8")]
    for member in graph.members:
        for name, kind, *shape in topic_fields(member.writes, joints[member.arm]):
            fields.append((name, kind, *(tuple(map(int, one)) for one in shape)))  # the arms differ in their joints
        prefix = f"{member.arm}_" if member.arm else ""
        fields += [(prefix + note[0], *note[1:]) for note in member.stage.notes]
    return kernels.record_dtype(fields)


_PACKAGE = Path(__file__).resolve().parents[1]
Rings = dict[tuple[str, str, str], Integers]
"""Past values on delayed links, by topic, reader and port; see :func:`_delay`."""
Views = Mapping[str, Any]
"""Arrays over the memory of a record's fields, by name."""


class Tick:
    """The composed tick of a graph; :meth:`run` executes it for each row.

    Args:
        dtype: Record type from :func:`block_dtype`.
        size: Largest number of ticks per call of the compiled loop.

    Attributes:
        program: Copies and calls of a tick.
        samples: Rows (size,) that played stages read.
        rows: Rows (size,) that the program writes.
    """

    def __init__(self, dtype: Any, size: int) -> None:
        self.program, self._size = Program(), size
        self.samples, self.rows = kernels.records(dtype, size), kernels.records(dtype, size)

    def run(self, first_ns: int, tick_ns: int, samples: Any, block: Any) -> None:
        """Run one tick for each row of ``block`` and write the results into ``block``.

        Args:
            first_ns: Time of the first tick [ns].
            tick_ns: Length of a tick [ns].
            samples: Recorded rows, as many as in ``block``, which replace the output of played stages; None if no
                stage is played.
            block: Output rows of the type of :func:`block_dtype`.

        Raises:
            TeleopError: A part in plain Python raised an exception, which is the cause of this error.
        """
        clock, rows, found = self.program.clock, _bytes(self.rows), _bytes(block)
        clock["tick_ns"] = tick_ns
        for begin in range(0, len(block), self._size):
            count = min(self._size, len(block) - begin)
            clock["first_ns"], clock["count"] = first_ns + begin * tick_ns, count
            if samples is not None:
                self.samples[:count] = samples[begin : begin + count]
            self._step()
            found[begin : begin + count] = rows[:count]

    def _step(self) -> None:
        try:
            self.program.run()
            kernels.raise_pending()
        except TeleopError:
            raise
        except Exception as error:
            raise raised_by(error) from error


def _bytes(rows: Any) -> Any:
    """View of the rows as plain bytes.

    NumPy would copy rows with fields field by field, which takes five times as long.
    """
    return np.ndarray.view(rows, np.dtype((np.void, rows.itemsize)))


def raised_by(error: Exception) -> PartError:
    """Error about an exception in a part in plain Python: one line that names function, file and line."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if _PACKAGE not in Path(frame.filename).parents]
    trace = (own or frames)[-1]
    reason = " ".join(str(error).split())
    text = f"one that does not raise; {type(error).__name__}: {reason} "
    return PartError("part", trace.name, f"{text}({Path(trace.filename).name}:{trace.lineno})")


def compose(
    graph: Graph, runners: Mapping[str, Runner], dtype: Any, dt: float, size: int, played: frozenset[str], rings: Rings
) -> Tick:
    """Compose the tick of a graph.

    Args:
        graph: The graph.
        runners: Running stages, by the names of their members.
        dtype: Record type from :func:`block_dtype`.
        dt: Length of a tick [s].
        size: Largest number of ticks per call of the compiled loop.
        played: Members whose topics come from recorded samples; they need no runner.
        rings: Values in transit on delayed links. Pass the rings of an earlier tick to keep these values; missing
            rings are added.
    """
    tick = Tick(dtype, size)
    program, rows = tick.program, np.asarray(tick.rows)
    program.copy(program.now_ns, rows["now_ns"], to_rows=True)
    views = {m.name: _played_views(m, rows) if m.name in played else _views(runners[m.name]) for m in graph.members}
    places = {member.name: i for i, member in enumerate(graph.members)}
    for member in graph.members:
        own = views[member.name]
        if member.name in played:
            _add_played(program, own, np.asarray(tick.samples), member)
        else:
            for link in graph.links_of(member):
                is_after = places[link.writer.name] > places[member.name]  # the value is one tick old
                ticks = round(link.delay / dt) + link.is_late - is_after
                _add_link(program, link, views, max(ticks, 0), rings)
            _add_step(program, member, runners[member.name], own, dt)
        _add_rows(program, member, own, rows)
    return tick


def _views(runner: Runner) -> Views:
    """Arrays of the signals of a stage."""
    whole = np.asarray(runner.signals)
    return {name: whole[name] for name in whole.dtype.names or ()}


def _played_views(member: Member, rows: Any) -> Views:
    """Arrays for the topics of a member without a runner."""
    found: dict[str, Any] = {}
    for topic, plain in zip(member.writes, member.stage.writes, strict=True):
        found[plain.field] = np.zeros(rows[topic.field].shape[1:])
        found[f"{plain.field}_ns"] = np.zeros((), np.int64)
    return found


def _add_played(program: Program, own: Views, samples: Any, member: Member) -> None:
    """Copy recorded samples to the topics of a member."""
    for topic, plain in zip(member.writes, member.stage.writes, strict=True):
        for end in ("", "_ns"):
            program.copy(samples[topic.field + end], own[plain.field + end], from_rows=True)


def _add_link(program: Program, link: Link, views: Mapping[str, Views], ticks: int, rings: Rings) -> None:
    """Copy a topic to its reader's port, or add it there; a delayed value passes through a ring of past values."""
    writer, reader = views[link.writer.name], views[link.reader.name]
    plain, port = _plain_field(link), link.port.field
    source, stamp = writer[plain], writer[f"{plain}_ns"]
    if ticks:
        key = (link.topic.name, link.reader.name, link.port.name)
        if key not in rings:
            begin = source if "now_ns" in writer else reader[port]  # played members have no beginning
            rings[key] = np.zeros((ticks + 1, source.size + 1), np.int64)
            rings[key][1:, :-1] = begin.view(np.int64)
        late = np.zeros(source.size + 1, np.int64)
        program.call(_delay, rings[key], source.view(np.int64), stamp.reshape(1), late)
        source, stamp = late[:-1].view(np.float64), late[-1:]
    if link.adds:
        program.call(add, source, reader[port])
    else:
        program.copy(source, reader[port])
        program.copy(stamp, reader[f"{port}_ns"])


@kernels.kernel
def _delay(ring: Integers, source: Integers, stamp: Integers, late: Integers) -> None:
    """Exchange the oldest value of a ring for the newest one.

    Args:
        ring: Row 0 begins with the index of the oldest value; rows (ticks, n + 1) of bits of values and a stamp [ns]
            follow.
        source: Bits of the newest value (n,).
        stamp: Its stamp (1,) [ns].
        late: Bits of the oldest value, and its stamp (n + 1,); written.
    """
    at, n = ring[0, 0] + 1, source.shape[0]
    for i in range(n):
        late[i], ring[at, i] = ring[at, i], source[i]
    late[n], ring[at, n] = ring[at, n], stamp[0]
    ring[0, 0] = at % (ring.shape[0] - 1)


def _plain_field(link: Link) -> str:
    """Field of the link's topic in the writer's record; these records have no namespaces."""
    own = {t.name: plain for t, plain in zip(link.writer.writes, link.writer.stage.writes, strict=True)}
    return own[link.topic.name].field


def _add_step(program: Program, member: Member, runner: Runner, own: Views, dt: float) -> None:
    """Call the kernel if its trigger is new, and stamp its outputs."""
    stage = member.stage
    program.copy(program.now_ns, own["now_ns"])
    if stage.trigger is None:
        _add_call(program, member, runner, own, dt)
        return
    with program.unless_equal(own[f"{stage.trigger.field}_ns"], own["answered_ns"]):
        _add_call(program, member, runner, own, dt)


def _add_call(program: Program, member: Member, runner: Runner, own: Views, dt: float) -> None:
    program.call(runner.kernel, *runner.arguments, runner.signals, dt)
    for topic in member.stage.writes:
        if topic.stamp.is_in_force:
            continue
        of = next((f"{t.field}_ns" for t in member.stage.reads if t.name == topic.stamp.of), "now_ns")
        program.copy(own[of], own[f"{topic.field}_ns"])


def _add_rows(program: Program, member: Member, own: Views, rows: Any) -> None:
    """Copy the topics and notes of a member to the row that is recorded."""
    for topic, plain in zip(member.writes, member.stage.writes, strict=True):
        for end in ("", "_ns"):
            program.copy(own[plain.field + end], rows[topic.field + end], to_rows=True)
    prefix = f"{member.arm}_" if member.arm else ""
    for note in member.stage.notes:
        if note[0] in own:  # played members have no notes
            program.copy(own[note[0]], rows[prefix + note[0]], to_rows=True)
