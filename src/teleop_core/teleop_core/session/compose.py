"""Compose: the tick of a graph as one compiled kernel, from generated source.

The source is a loop over ticks that copies values from record to record along the links, calls the
kernel of each stage, stamps what it wrote and copies it to the row that is recorded. Stages that
are plain Python cut it into segments, between which they are called. What was compiled once is
loaded from disk by every later session of the same graph.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from teleop_core.graph import Graph, Link, Member
from teleop_core.kernels import bound, is_kernel, kernel_from_source, raise_pending, records
from teleop_core.signals import add, assign, copy, topic_fields
from teleop_core.stage import Runner

__all__ = ["Tick", "block_dtype", "compose"]


def block_dtype(graph: Graph, joints: Mapping[str, int]) -> Any:
    """Record of everything that happens in a tick: ``now_ns``, all topics with stamps, and notes.

    Args:
        graph: The graph.
        joints: Number of joints of each namespace's arm.
    """
    fields: list[Any] = [("now_ns", "i8")]
    for member in graph.members:
        fields += topic_fields(member.writes, joints[member.arm])
        prefix = f"{member.arm}_" if member.arm else ""
        fields += [(prefix + note[0], *note[1:]) for note in member.stage.notes]
    return np.dtype((np.record, np.dtype(fields)))


@dataclass
class _Text:
    """Source being written, with the objects that it names."""

    lines: list[str] = field(default_factory=list)
    segments: list[list[str] | int] = field(default_factory=list)
    objects: dict[str, Any] = field(default_factory=dict)

    def say(self, *lines: str) -> None:
        self.lines += lines

    def cut(self, number: int) -> None:
        """End a segment: here the plain stage of this number is called."""
        self.segments += [self.lines, number]
        self.lines = []


class Tick:
    """The composed tick: :meth:`run` it over rows.

    Attributes:
        source: The generated source, for the curious.
    """

    def __init__(
        self, text: _Text, plain: dict[int, Callable[[], None]], dtype: Any, dt: float
    ) -> None:
        self._plain, self._dt = plain, dt
        self._row = records(dtype)[0]
        names = tuple(text.objects)
        self._values = tuple(text.objects.values())
        kernels = {n: v for n, v in text.objects.items() if is_kernel(v)}
        given = [name for name in names if name not in kernels]
        parts = [*text.segments, text.lines]
        texts = [
            _loop(given, lines, has_loop=not plain) for lines in parts if not isinstance(lines, int)
        ]
        self.source = "\n\n".join(texts)
        made = iter(
            [kernel_from_source(t, "tick", {**kernels, "copy": copy, "add": add}) for t in texts]
        )
        self._steps: list[Callable[..., Any] | int] = [
            part if isinstance(part, int) else next(made) for part in parts
        ]
        self._arguments = tuple(text.objects[name] for name in given)

    def run(self, first_ns: int, tick_ns: int, samples: Any, block: Any) -> None:
        """Make one tick for each row of ``block``, which is filled.

        Args:
            first_ns: Time of the first tick [ns].
            tick_ns: From tick to tick [ns].
            samples: Recorded rows in place of stages that are played, as long as ``block``.
            block: Rows of :func:`block_dtype`.
        """
        if not self._plain:
            self._steps[0](self._arguments, first_ns, tick_ns, self._dt, samples, block)  # type: ignore[operator]
            raise_pending()
            return
        self._run_plain(first_ns, tick_ns, samples, block)

    def _run_plain(self, first_ns: int, tick_ns: int, samples: Any, block: Any) -> None:
        clock, row, sample = records([("now_ns", "i8")])[0], self._row, samples[0].copy()
        calls = [
            self._plain[step] if isinstance(step, int)
            else bound(step, self._arguments, clock, self._dt, sample, row)
            for step in self._steps
        ]  # fmt: skip
        for i in range(len(block)):
            clock["now_ns"] = first_ns + i * tick_ns
            assign(sample, samples[min(i, len(samples) - 1)])
            for call in calls:
                call()
            raise_pending()
            block[i] = row


def _loop(given: Sequence[str], lines: Sequence[str], *, has_loop: bool) -> str:
    """Source of one segment; alone, it loops over the rows itself."""
    unpacked = [f"    {name} = given[{i}]" for i, name in enumerate(given)]
    if not has_loop:
        head = ["def tick(given, clock, dt, sample, row):", *unpacked, "    now_ns = clock.now_ns"]
        return "\n".join([*head, *(f"    {line}" for line in lines), "    row.now_ns = now_ns"])
    head = [
        "def tick(given, first_ns, tick_ns, dt, samples, block):", *unpacked,
        "    for i in range(block.shape[0]):",
        "        now_ns = first_ns + i * tick_ns",
        "        row = block[i]",
        "        sample = samples[min(i, samples.shape[0] - 1)]",
        "        row.now_ns = now_ns",
    ]  # fmt: skip
    return "\n".join([*head, *(f"        {line}" for line in lines)])


def compose(
    graph: Graph,
    runners: Mapping[str, Runner],
    dtype: Any,
    dt: float,
    played: frozenset[str] = frozenset(),
) -> Tick:
    """Tick of a graph.

    Args:
        graph: The graph.
        runners: Stages at work, by the names of their members.
        dtype: Record of :func:`block_dtype`.
        dt: Length of a tick [s].
        played: Members whose topics come from recorded samples; they need no runner.
    """
    text, plain = _Text(), {}
    places = {member.name: i for i, member in enumerate(graph.members)}
    for number, member in enumerate(graph.members):
        if member.name in played:
            _say_played(text, member)
            continue
        runner = runners[member.name]
        text.objects |= {f"r{number}": runner.signals, f"a{number}": runner.arguments}
        is_compiled = is_kernel(runner.kernel)
        if is_compiled:
            text.objects[f"k{number}"] = runner.kernel
        for link in graph.links_of(member):
            _say_link(text, link, places, runners, played, dt)
        text.say(f"r{number}.now_ns = now_ns")
        if not is_compiled:
            text.cut(number)
            plain[number] = _caller(member, runner, dt)
        _say_step(text, number, member, len(runner.arguments), is_compiled=is_compiled)
    return Tick(text, plain, dtype, dt)


def _say_played(text: _Text, member: Member) -> None:
    for topic in member.writes:
        text.say(
            f"copy(sample.{topic.field}, row.{topic.field})",
            f"row.{topic.field}_ns = sample.{topic.field}_ns",
        )


def _say_link(
    text: _Text, link: Link, places: Mapping[str, int], runners: Mapping[str, Runner],
    played: frozenset[str], dt: float,
) -> None:  # fmt: skip
    """Lead a value to the port of its reader, through a ring of past ones if it is delayed."""
    reader, port = f"r{places[link.reader.name]}", link.port.field
    writer, plain = places[link.writer.name], _plain_field(link)
    source, stamp = f"r{writer}.{plain}", f"r{writer}.{plain}_ns"
    if link.writer.name in played:
        source, stamp = f"row.{link.topic.field}", f"row.{link.topic.field}_ns"
    is_after = writer > places[link.reader.name] and not link.is_late
    ticks = round(link.delay / dt) - is_after
    how = "add" if link.adds else "copy"
    if ticks <= 0:
        text.say(f"{how}({source}, {reader}.{port})")
    else:
        ring = f"d{len(text.objects)}"
        text.objects[ring] = _ring(ticks, link, runners)
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
    """Field of the topic in its writer's record, which knows no namespaces."""
    own = {
        t.name: plain for t, plain in zip(link.writer.writes, link.writer.stage.writes, strict=True)
    }
    return own[link.topic.name].field


def _ring(ticks: int, link: Link, runners: Mapping[str, Runner]) -> Any:
    """Past values of a link, full of what its writer holds at the start."""
    writer = runners.get(link.writer.name)
    reader = runners[link.reader.name].signals[link.port.field]
    begin = writer.signals[_plain_field(link)] if writer is not None else reader
    ring = records([("values", "f8", begin.shape), ("stamp_ns", "i8"), ("at", "i8")], ticks)
    ring["values"] = begin
    return ring


def _say_step(text: _Text, number: int, member: Member, count: int, *, is_compiled: bool) -> None:
    """Call the kernel where there is something to answer; stamp and record what it wrote."""
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
        text.say(f"if {trigger} != 0:", *(f"    {line}" for line in lines))
    else:
        text.say(*lines)
    prefix = f"{member.arm}_" if member.arm else ""
    for topic, plain in zip(member.writes, stage.writes, strict=True):
        text.say(
            f"copy({row}.{plain.field}, row.{topic.field})",
            f"row.{topic.field}_ns = {row}.{plain.field}_ns",
        )
    for note in stage.notes:
        value = f"{row}.{note[0]}"
        is_row = len(note) > 2
        target = f"row.{prefix}{note[0]}"
        text.say(f"copy({value}, {target})" if is_row else f"{target} = {value}")


def _caller(member: Member, runner: Runner, dt: float) -> Callable[[], None]:
    """Call of a plain stage, which answers only when there is something to answer."""
    trigger = member.stage.trigger
    arguments, row, step = runner.arguments, runner.signals, runner.kernel

    def call() -> None:
        if trigger is None or row[f"{trigger.field}_ns"] != 0:
            step(*arguments, row, dt)

    return call
