"""Compose: the tick of a graph as one compiled kernel, from generated source.

The source is a loop over ticks. It copies values from record to record along the links, calls the kernel of each stage,
stamps the topics that the stage wrote and copies them to the row that is recorded. Stages in plain Python divide the
source into segments and are called between the segments. Compiled kernels are stored on disk, where later sessions of
the same graph load them.
"""

import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from teleop_core import kernels
from teleop_core.base.errors import PartError, TeleopError
from teleop_core.graph.graph import Graph, Link, Member
from teleop_core.graph.signals import add, copy, topic_fields
from teleop_core.graph.stage import Runner

__all__ = ["Tick", "block_dtype", "compose"]


def block_dtype(graph: Graph, joints: Mapping[str, int]) -> Any:
    """NumPy record type of all data of a tick: ``now_ns``, all topics with stamps, and the stages' notes.

    Args:
        graph: The graph.
        joints: Number of joints of each arm, by its namespace.
    """
    fields: list[Any] = [("now_ns", "i8")]
    for member in graph.members:
        fields += topic_fields(member.writes, joints[member.arm])
        prefix = f"{member.arm}_" if member.arm else ""
        fields += [(prefix + note[0], *note[1:]) for note in member.stage.notes]
    return kernels.record_dtype(fields)


Segment = list[str]
"""Lines of source that become one kernel."""
Call = Callable[[], None]


@dataclass
class _Text:
    """Source under construction: segments, and calls of plain-Python stages between the segments."""

    parts: list[Segment | Call] = field(default_factory=lambda: [[]])
    objects: dict[str, Any] = field(default_factory=dict)

    def say(self, *lines: str) -> None:
        """Add lines to the current segment."""
        segment = self.parts[-1]
        assert isinstance(segment, list)
        segment += lines

    def call(self, call: Call) -> None:
        """End the current segment, add a call of a plain-Python stage and begin a new segment."""
        self.parts += [call, []]


_PACKAGE = Path(__file__).resolve().parents[1]
Rings = dict[tuple[str, str, str], Any]
"""Past values on delayed links, by topic, reader and port."""
_CLOCK = [("first_ns", "i8"), ("tick_ns", "i8"), ("count", "i8")]


class Tick:
    """The composed tick of a graph; :meth:`run` executes it for each row.

    Kernels are bound once to the buffers of this object. A check of the types of all arguments in each call would take
    as long as a hundred ticks.

    Args:
        text: Generated source of the graph, with its objects.
        dtype: Record type from :func:`block_dtype`.
        dt: Length of a tick [s].
        size: Largest number of ticks per call of the kernel.

    Attributes:
        source: The generated source, for inspection.
    """

    def __init__(self, text: _Text, dtype: Any, dt: float, size: int) -> None:
        self._is_whole = len(text.parts) == 1
        self._size = size if self._is_whole else 1
        self._clock = kernels.records(_CLOCK)[0]
        self._samples, self._rows = (kernels.records(dtype, self._size), kernels.records(dtype, self._size))
        given = tuple(text.objects.values())
        known = {"copy": copy, "add": add}
        sources = [_source(text.objects, part) for part in text.parts if isinstance(part, list)]
        self.source = "\n\n".join(sources)
        made = iter(sources)
        self._calls: list[Callable[[], object]] = [
            kernels.bound(
                kernels.kernel_from_source(next(made), "tick", known), given, self._clock, dt, self._samples, self._rows
            )
            if isinstance(part, list)
            else part
            for part in text.parts
        ]

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
        clock, rows, found = self._clock, _bytes(self._rows), _bytes(block)
        clock["tick_ns"] = tick_ns
        for begin in range(0, len(block), self._size):
            count = min(self._size, len(block) - begin)
            clock["first_ns"], clock["count"] = first_ns + begin * tick_ns, count
            if samples is not None:
                self._samples[:count] = samples[begin : begin + count]
            self._step()
            found[begin : begin + count] = rows[:count]

    def _step(self) -> None:
        try:
            for call in self._calls:
                call()
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


def _source(given: Iterable[str], lines: Sequence[str]) -> str:
    """Source of one segment: a loop over the rows."""
    head = [
        "def tick(given, clock, dt, samples, rows):",
        *(f"    {name} = given[{i}]" for i, name in enumerate(given)),
        "    for i in range(clock.count):",
        "        now_ns = clock.first_ns + i * clock.tick_ns",
        "        row, sample = rows[i], samples[i]",
        "        row.now_ns = now_ns",
    ]
    return "\n".join([*head, *(f"        {line}" for line in lines)])


def compose(
    graph: Graph, runners: Mapping[str, Runner], dtype: Any, dt: float, size: int, played: frozenset[str], rings: Rings
) -> Tick:
    """Compose the tick of a graph.

    Args:
        graph: The graph.
        runners: Running stages, by the names of their members.
        dtype: Record type from :func:`block_dtype`.
        dt: Length of a tick [s].
        size: Largest number of ticks per call of the kernel.
        played: Members whose topics come from recorded samples; they need no runner.
        rings: Values in transit on delayed links. Pass the rings of an earlier tick to keep these values; missing
            rings are added.
    """
    text = _Text()
    places = {member.name: i for i, member in enumerate(graph.members)}
    for number, member in enumerate(graph.members):
        if member.name in played:
            _say_played(text, member)
            continue
        runner = runners[member.name]
        text.objects |= {f"r{number}": runner.signals, f"a{number}": runner.arguments}
        is_compiled = kernels.is_kernel(runner.kernel)
        if is_compiled:
            text.objects[f"k{number}"] = kernels.apart(runner.kernel, *runner.arguments, runner.signals, dt)
        for link in graph.links_of(member):
            _say_link(text, link, places, runners, played, dt, rings)
        text.say(f"r{number}.now_ns = now_ns")
        if not is_compiled:
            text.call(_caller(member, runner, dt))
        _say_step(text, number, member, len(runner.arguments), is_compiled=is_compiled)
    return Tick(text, dtype, dt, size)


def _say_played(text: _Text, member: Member) -> None:
    for topic in member.writes:
        text.say(f"copy(sample.{topic.field}, row.{topic.field})", f"row.{topic.field}_ns = sample.{topic.field}_ns")


def _say_link(
    text: _Text,
    link: Link,
    places: Mapping[str, int],
    runners: Mapping[str, Runner],
    played: frozenset[str],
    dt: float,
    rings: Rings,
) -> None:
    """Add the lines that copy a value to its reader's port; a delayed value passes through a ring of past values."""
    reader, port = f"r{places[link.reader.name]}", link.port.field
    writer, plain = places[link.writer.name], _plain_field(link)
    source, stamp = f"r{writer}.{plain}", f"r{writer}.{plain}_ns"
    if link.writer.name in played:
        source, stamp = f"row.{link.topic.field}", f"row.{link.topic.field}_ns"
    is_after = writer > places[link.reader.name]  # the value is one tick old
    ticks = round(link.delay / dt) + link.is_late - is_after
    how = "add" if link.adds else "copy"
    if ticks <= 0:
        text.say(f"{how}({source}, {reader}.{port})")
    else:
        ring = f"d{len(text.objects)}"
        key = (link.topic.name, link.reader.name, link.port.name)
        text.objects[ring] = rings.setdefault(key, _ring(ticks, link, runners))
        past = f"past_{ring}"
        text.say(
            f"{past} = {ring}[{ring}[0].at]",
            f"{how}({past}.values, {reader}.{port})",
            f"{past}_ns = {past}.stamp_ns",
            f"copy({source}, {past}.values)",
            f"{past}.stamp_ns = {stamp}",
            f"{ring}[0].at = ({ring}[0].at + 1) % {ring}.shape[0]",
        )
        stamp = f"{past}_ns"
    if not link.adds:
        text.say(f"{reader}.{port}_ns = {stamp}")


def _plain_field(link: Link) -> str:
    """Field of the link's topic in the writer's record; these records have no namespaces."""
    own = {t.name: plain for t, plain in zip(link.writer.writes, link.writer.stage.writes, strict=True)}
    return own[link.topic.name].field


def _ring(ticks: int, link: Link, runners: Mapping[str, Runner]) -> Any:
    """Ring of past values of a link, filled with the writer's initial value."""
    writer = runners.get(link.writer.name)
    reader = runners[link.reader.name].signals[link.port.field]
    begin = writer.signals[_plain_field(link)] if writer is not None else reader
    ring = kernels.records([("values", "f8", begin.shape), ("stamp_ns", "i8"), ("at", "i8")], ticks)
    ring["values"] = begin
    return ring


def _say_step(text: _Text, number: int, member: Member, count: int, *, is_compiled: bool) -> None:
    """Add the lines that call the kernel if its trigger is new, and stamp and record its outputs."""
    stage, row = member.stage, f"r{number}"
    lines = []
    if is_compiled:
        arguments = "".join(f"a{number}[{i}], " for i in range(count))
        lines.append(f"k{number}({arguments}{row}, dt)")
    for topic in stage.writes:
        if topic.stamp.is_in_force:
            continue
        of = next((t.field for t in stage.reads if t.name == topic.stamp.of), None)
        lines.append(f"{row}.{topic.field}_ns = " + (f"{row}.{of}_ns" if of else "now_ns"))
    if stage.trigger is not None:
        trigger = f"{row}.{stage.trigger.field}_ns"
        lines.insert(0, f"{row}.answered_ns = {trigger}")
        text.say(f"if {trigger} != {row}.answered_ns:", *(f"    {line}" for line in lines))
    else:
        text.say(*lines)
    prefix = f"{member.arm}_" if member.arm else ""
    for topic, plain in zip(member.writes, stage.writes, strict=True):
        text.say(f"copy({row}.{plain.field}, row.{topic.field})", f"row.{topic.field}_ns = {row}.{plain.field}_ns")
    for note in stage.notes:
        value = f"{row}.{note[0]}"
        is_row = len(note) > 2
        target = f"row.{prefix}{note[0]}"
        text.say(f"copy({value}, {target})" if is_row else f"{target} = {value}")


def _caller(member: Member, runner: Runner, dt: float) -> Callable[[], None]:
    """Function that calls a plain-Python stage if its trigger is new."""
    trigger = member.stage.trigger
    arguments, row, step = runner.arguments, runner.signals, runner.kernel

    def call() -> None:
        if trigger is None or row[f"{trigger.field}_ns"] != row["answered_ns"]:
            step(*arguments, row, dt)

    return call
