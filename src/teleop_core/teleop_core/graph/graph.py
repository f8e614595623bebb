"""Graph: stages, links between stages, and arms; the single description of what a session runs.

Virtual time, replay, nodes, recorder, evaluation and diagrams derive everything from the graph: the order of a tick,
which topic feeds which port, which links are delayed, and which topics are summed.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

from teleop_core.base.errors import ParameterError, PartError, UnknownNameError
from teleop_core.graph.stage import STAGES, Stage
from teleop_core.graph.topics import BY_NAME, Kind, Topic

__all__ = ["BUILT_IN", "DEVICE", "HAND", "RECORDER_NAME", "Delay", "Graph", "Link", "Member", "build_graph"]

BUILT_IN = ("operator", "haptic_master", "motion_scaling", "inverse_kinematics", "slave", "slave_sim")
"""Names of the stages that every arm has."""
HAND, DEVICE = BUILT_IN[:2]
"""Stages from whose recorded output a replay can start."""
RECORDER_NAME, FRAMES_NAME = "recorder", "frames"
"""Nodes beside the stages of every session."""
_WAYS = {"first": 0, "second": 1}  # maps prefixes of ports between arms to the index of the arm that writes


@dataclass(frozen=True)
class Member:
    """A stage of one arm; ``arm`` is its namespace, empty for the default arm."""

    stage: Stage
    arm: str = ""

    @property
    def name(self) -> str:
        """Name of the node, with its namespace: ``left/slave``."""
        return f"{self.arm}/{self.stage.name}" if self.arm else self.stage.name

    @property
    def writes(self) -> tuple[Topic, ...]:
        """Topics that the stage writes, in the namespace of its arm."""
        return tuple(topic.of_arm(self.arm) for topic in self.stage.writes)


@dataclass(frozen=True)
class Link:
    """Connection of one topic from its writer to one reader.

    Attributes:
        topic: The topic, in its namespace.
        writer: Stage that writes the topic.
        reader: Stage that reads the topic.
        port: Port of the reader: the topic that the reading stage declares.
        delay: Delay [s], in addition to the one tick of late links.
        is_late: Whether the reader gets the value from the end of the last tick.
        adds: Whether the value is added to the other values at the port.
    """

    topic: Topic
    writer: Member
    reader: Member
    port: Topic
    delay: float = 0.0
    is_late: bool = False
    adds: bool = False


@dataclass(frozen=True)
class Delay:
    """A delay of a topic, on its link to one reader or to all readers."""

    topic: str
    seconds: float
    reader: str = ""

    @staticmethod
    def parse(text: str) -> "Delay":
        """Delay from ``topic=seconds`` or ``topic@reader=seconds``.

        Raises:
            ParameterError: The text does not have this form, or the time is not between 0 and 60 s.
        """
        link, equals, time = text.partition("=")
        topic, _, reader = link.strip().partition("@")
        try:
            seconds = float(time)
        except ValueError:
            seconds = -1.0
        if not equals or not topic or not 0.0 <= seconds <= 60.0:
            form = "topic=seconds or topic@reader=seconds, from 0 to 60 s: slave/servo_jp=0.02"
            raise ParameterError("teleop.delays", text, form)
        return Delay(topic.removeprefix("/"), seconds, reader)


@dataclass(frozen=True)
class Graph:
    """Stages, arms and delays, checked.

    Attributes:
        stages: Stages of every arm; their order decides where the data flow does not determine the order.
        arms: Names of the arms; the first is the default one, whose topics have plain names.
        delays: Delays on links.

    Raises:
        PartError: The graph cannot run; the message names the stage and what was expected.
    """

    stages: tuple[Stage, ...]
    arms: tuple[str, ...] = ("",)
    delays: tuple[Delay, ...] = field(default=())

    def __post_init__(self) -> None:
        """Refuse a graph that cannot run, before anything runs."""
        for kind, names in (("arm", self.arms), ("stage", [s.name for s in self.stages])):
            for name in names:
                if list(names).count(name) > 1:
                    raise PartError(kind, name, "named once; two of them have this name")
        for arm in self.arms[1:]:
            if not (arm.isidentifier() and arm.isascii()):
                text = "a name of letters, digits and _ that does not begin with a digit"
                raise PartError("arm", arm, text)
        self._check_writers()
        self._check_fields()
        self._check_delays()
        _ = self.members

    @property
    def namespaces(self) -> tuple[str, ...]:
        """Namespace of each arm: empty for the default one."""
        return ("", *self.arms[1:])

    def _all(self) -> Iterator[Member]:
        for arm in self.namespaces:
            for stage in self.stages:
                yield Member(stage, arm)

    # -- checks ----------------------------------------------------------------------------------

    def _check_writers(self) -> None:
        writers: dict[str, Stage] = {}
        for stage in self.stages:
            for topic in stage.writes:
                if topic.name in writers:
                    text = f"the only one that writes {topic.name}; {writers[topic.name].name} writes it too"
                    raise PartError("stage", stage.name, text)
                writers[topic.name] = stage
        for stage in self.stages:
            optional = {topic.name for topic in stage.optional}
            for topic in stage.reads:
                if topic.name not in {*writers, *optional} and not self._adding(topic):
                    have = ", ".join(sorted(writers)) or "nothing"
                    text = f"given {topic.name}, but no stage writes it; stages write {have}"
                    raise PartError("stage", stage.name, text)

    def _check_fields(self) -> None:
        """Refuse two topics or notes that would share a column of the rows of a session."""
        owners: dict[str, str] = {}
        for stage in self.stages:
            fields = [name for t in stage.writes for name in (t.field, f"{t.field}_ns")]
            for name in [*fields, *(note[0] for note in stage.notes)]:
                if name in owners:
                    text = f"one without the topic or note {name}, a name that {owners[name]} uses"
                    raise PartError("stage", stage.name, text)
                owners[name] = stage.name

    def _adding(self, topic: Topic) -> list[tuple[Stage, Topic]]:
        """Other topics that are added to this topic, with their writers."""
        return [(s, t) for s in self.stages for t in s.writes if t.adds_to == topic.name]

    def _check_delays(self) -> None:
        known = {topic.name for topic in self.topics}
        readers = {stage.name for stage in self.stages}
        for delay in self.delays:
            if delay.topic not in known:
                raise UnknownNameError("delayed topic", delay.topic, sorted(known))
            if delay.reader and delay.reader not in readers:
                raise UnknownNameError("reader of a delayed topic", delay.reader, sorted(readers))
            if not any(link.delay for link in self.links if link.topic.name == delay.topic) and (delay.seconds > 0.0):
                text = f"one that reads {delay.topic}"
                raise PartError("delayed stage", delay.reader or "?", text)

    # -- what follows from it --------------------------------------------------------------------

    @cached_property
    def topics(self) -> tuple[Topic, ...]:
        """All topics that stages write, arm by arm."""
        return tuple(topic for member in self._all() for topic in member.writes)

    @property
    def streams(self) -> tuple[Topic, ...]:
        """Topics with one message per step."""
        return tuple(topic for topic in self.topics if topic.kind is not Kind.REPORT)

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """All links, reader by reader; at each port, the main link comes before links whose values are added to it.

        The second arm's port ``first/topic`` receives the first arm's ``topic``. The first arm's port ``second/topic``
        receives the second arm's ``topic``. Such ports of further arms receive nothing.
        """
        return tuple(
            link for member in self._all() for port in member.stage.reads for link in self._links_to(member, port)
        )

    def _links_to(self, reader: Member, port: Topic) -> Iterator[Link]:
        way, _, plain = port.name.partition("/")
        if way in _WAYS:
            to, of = (self.namespaces.index(reader.arm), _WAYS[way])
            if {to, of} == {0, 1} and len(self.arms) > 1:
                yield from self._link_between(reader, port, plain, self.namespaces[of])
            return
        source = self._source(reader.stage, port)
        feeds = [(*source, False)] if source is not None else []
        feeds += [(*found, bool(feeds) or i > 0) for i, found in enumerate(self._adding(port))]
        is_late = any(topic.name == port.name for topic in reader.stage.late)
        for stage, topic, adds in feeds:
            own = topic.of_arm(reader.arm)
            delay = self._delay(own, reader.stage)
            yield Link(own, Member(stage, reader.arm), reader, port, delay, is_late, adds)

    def _link_between(self, reader: Member, port: Topic, plain: str, arm: str) -> Iterator[Link]:
        """Link from a stage of another arm, if a stage of that arm writes the topic with this plain name."""
        for stage in self.stages:
            for topic in stage.writes:
                if topic.name == plain:
                    own, is_late = topic.of_arm(arm), port in reader.stage.late
                    delay = self._delay(own, reader.stage)
                    yield Link(own, Member(stage, arm), reader, port, delay, is_late)

    def _source(self, reader: Stage, port: Topic) -> tuple[Stage, Topic] | None:
        found = None
        for stage in self.stages:
            for topic in stage.writes:
                if topic.name == port.name:
                    found = (stage, topic)
        served = None
        for stage in self.stages:
            for old, new in zip(stage.replaced, stage.writes, strict=False):
                if old.name != port.name:
                    continue
                if stage is reader and not stage.serves:
                    return found
                own = {reader.name, f"{port.name}@{reader.name}"}
                if reader.name in stage.serves:
                    served = (stage, new)
                elif not stage.serves and own.isdisjoint(stage.spares):
                    found = (stage, new)
        return served or found

    def _delay(self, topic: Topic, reader: Stage) -> float:
        fitting = [d for d in self.delays if d.topic == topic.name]
        return sum(d.seconds for d in fitting if d.reader in {"", reader.name})

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """Stages of all arms in the order of a tick: every stage after the stages whose output it needs.

        Raises:
            PartError: The stages need each other in a cycle.
        """
        waiting = list(self._all())
        needs = {member.name: set[str]() for member in waiting}
        for link in self.links:
            if not link.is_late and link.delay == 0.0:
                needs[link.reader.name].add(link.writer.name)
        ordered: list[Member] = []
        while waiting:
            done = {member.name for member in ordered}
            ready = next((m for m in waiting if needs[m.name] <= done), None)
            if ready is None:
                circle = ", ".join(member.name for member in waiting)
                text = f"given one of its inputs as late or delayed, because {circle} wait for each other"
                raise PartError("stage", waiting[0].stage.name, text)
            waiting.remove(ready)
            ordered.append(ready)
        return tuple(ordered)

    def played(self, begin: str) -> tuple[Member, ...]:
        """Stages whose topics are taken from a recording in a replay, arm by arm.

        Args:
            begin: The last of these stages: :data:`HAND`, :data:`DEVICE`, or empty for none.
        """
        names = BUILT_IN[: BUILT_IN.index(begin) + 1] if begin else ()
        return tuple(m for m in self.members if m.stage.name in names)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on probable mistakes: a stage reads a topic, but no stage reads its own topic of the same kind."""
        read = {link.topic.name for link in self.links}
        found = []
        for stage in self.stages:
            for topic in stage.writes:
                alike = [t.name for t in stage.reads if t.kind is topic.kind]
                is_lost = topic.name not in read and not topic.adds_to and not stage.replaced
                is_lost = is_lost and topic.name not in BY_NAME
                if is_lost and alike and stage.name not in BUILT_IN:
                    found.append(
                        f"stage {stage.name!r} writes {topic.name}, which no stage reads; with replaces= it would "
                        f"reach the readers of {alike[0]}"
                    )
        return tuple(found)

    def links_of(self, member: Member) -> tuple[Link, ...]:
        """Links whose reader is the given stage."""
        return tuple(link for link in self.links if link.reader == member)

    def chain(self, arm: str = "") -> tuple[tuple[str, Topic], ...]:
        """Path of a master's sample to the slave: stages, each with its output topic.

        The path begins at the stage :data:`DEVICE` and follows the stamps: each next stage answers the previous topic
        and copies its stamp.
        """
        first = Member(next(stage for stage in self.stages if stage.name == DEVICE), arm)
        found = [(first.stage.name, first.writes[0])]
        while (nxt := self._answer(found[-1][1], {name for name, _ in found})) is not None:
            found.append(nxt)
        return tuple(found)

    def _answer(self, topic: Topic, seen: set[str]) -> tuple[str, Topic] | None:
        for link in self.links:
            if link.topic != topic or link.reader.stage.name in seen:
                continue
            for written, plain in zip(link.reader.writes, link.reader.stage.writes, strict=True):
                if plain.stamp.of == link.port.name and self._goes_on(written):
                    return link.reader.stage.name, written
        return None

    def _goes_on(self, topic: Topic) -> bool:
        """Whether the topic is part of the path from master to slave, not of the path back."""
        return topic.kind is not Kind.REPORT and (
            topic.stamp.is_in_force or any(link.topic == topic and not link.is_late for link in self.links)
        )


def build_graph(arms: Iterable[str] = (), stages: Iterable[str] = (), delays: Iterable[str] = ()) -> Graph:
    """Graph of the built-in stages and of further stages.

    Args:
        arms: Names of the arms, the default arm first; if empty, there is one arm without a name.
        stages: Names of further stages.
        delays: Delays as :meth:`Delay.parse` takes them.

    Raises:
        TeleopError: A name is unknown or used twice, or the graph cannot run.
    """
    names = (*BUILT_IN, *stages)
    for name in {RECORDER_NAME, FRAMES_NAME}.intersection(names):
        raise PartError("stage", name, "left out of the stages; it is always there")
    return Graph(
        _demanded(tuple(STAGES.find(name) for name in names)),
        tuple(arms) or ("",),
        tuple(Delay.parse(text) for text in delays),
    )


def _demanded(stages: tuple[Stage, ...]) -> tuple[Stage, ...]:
    """The stages, without on-demand outputs that no stage reads."""
    needed = {topic.name for stage in stages for topic in stage.reads if topic not in stage.optional}
    written = {
        topic.name for stage in stages for topic in stage.writes if topic not in stage.on_demand or topic.name in needed
    }
    return tuple(_pruned(stage, needed, written) for stage in stages)


def _pruned(stage: Stage, needed: set[str], written: set[str]) -> Stage:
    old = dict(zip(stage.writes, stage.replaced, strict=False))
    left = {
        topic for topic in stage.on_demand if topic.name not in needed and old.get(topic, topic).name not in written
    }
    if not left:
        return stage
    return replace(
        stage,
        writes=tuple(topic for topic in stage.writes if topic not in left),
        replaces=tuple(topic for new, topic in old.items() if new not in left) or None,
        on_demand=tuple(topic for topic in stage.on_demand if topic not in left),
    )
