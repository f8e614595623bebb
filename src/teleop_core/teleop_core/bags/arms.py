"""Arms: a recording of several arms, seen as one recording per arm.

Topics of the default arm have the plain names; those of an arm called ``left`` are below ``left/``. The metadata entry
``arms`` lists the names of the arms, separated by blanks, the default arm first. Robot and seed of a further arm are
in the entries ``left/robot`` and ``left/seed``. All arms share the topic ``diagnostics``, in which the nodes of an arm
are called ``left/slave``.

If the recorder ran in a namespace, all topics are below that namespace, which the metadata contain under
``namespace``. The names of the arms do not contain the namespace: topics of the arm ``left`` in ``/lab`` are below
``lab/left/``.

If no metadata name the arms, for example because a recorder ran alone in a namespace, each topic of a slave's measured
pose is one arm: ``left/slave/measured_cp`` is the arm ``left``. Such a recording may have no default arm with plain
topics.
"""

from collections.abc import Iterable, Iterator

from teleop_core.bags.reader import Bag, Series, TopicInfo
from teleop_core.bags.reports import Report
from teleop_core.base.errors import RecordingError, UnknownNameError
from teleop_core.graph.topics import DIAGNOSTICS, SLAVE_MEASURED_CP, Topic

ARMS_KEY = "arms"
NAMESPACE_KEY = "namespace"
PLAYED_KEY = "played"
"""Metadata entry: the last stage whose topics a replay took from a file instead of simulating them."""
_OF_ONE_ARM = {"robot", "robot_file", "robot_meshes", "seed", "mesh", "mesh_file", "drives", "drives_file"}


def arm_names(bag: Bag) -> tuple[str, ...]:
    """Names of a recording's arms, the default arm first; ``("",)`` if the only arm has no name.

    Raises:
        RecordingError: The metadata of the recording name an arm twice.
    """
    names = _named(bag) or _measured_arms(bag)
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        raise RecordingError(bag.path, f"names the arm {twice[0]} twice: {' '.join(names)}")
    return names


def _named(bag: Bag) -> tuple[str, ...]:
    return tuple(bag.metadata.get(ARMS_KEY, "").split())


def _measured_arms(bag: Bag) -> tuple[str, ...]:
    """Namespaces with a measured pose of a slave; the namespace of plain topics is empty and comes first."""
    names = [name for name, info in bag.topics.items() if info.count]
    end = f"/{SLAVE_MEASURED_CP.name}"
    found = [name.removesuffix(end) for name in names if name.endswith(end)]
    is_plain = SLAVE_MEASURED_CP.name in names or not found
    return ("",) * is_plain + tuple(sorted(found))


def of_arm(bag: Bag, arm: str = "") -> Bag:
    """View of a recording that contains only one arm, whose topics have plain names.

    Args:
        bag: The recording, which stays open as long as the view is used.
        arm: Name of an arm; empty for the default one.

    Raises:
        UnknownNameError: The recording has no such arm.
        RecordingError: The metadata of the recording name an arm twice.
    """
    prefixes = _prefixes(bag)
    prefix = _prefix(bag, arm, prefixes)
    if set(prefixes.values()) == {""}:
        return bag
    return _ArmBag(bag, prefix, tuple(prefixes.values()), _base(bag) if _named(bag) else "")


def topic_prefix(bag: Bag, arm: str = "") -> str:
    """Prefix of the names of an arm's topics in a recording. Raises the same errors as :func:`of_arm`."""
    return _prefix(bag, arm, _prefixes(bag))


def _prefix(bag: Bag, arm: str, prefixes: dict[str, str]) -> str:
    if arm and arm not in prefixes:
        known = list(filter(None, prefixes)) or ["'' (the recording names no arms)"]
        raise UnknownNameError(f"arm of {bag.path}", arm, known)
    return prefixes[arm or next(iter(prefixes))]


def _prefixes(bag: Bag) -> dict[str, str]:
    """Prefix of the topic names of each arm; the default arm is the first."""
    arms = arm_names(bag)
    base = _base(bag) if _named(bag) else ""
    prefixes = {arm: f"{base}{arm}/" for arm in arms}
    if _named(bag) or not arms[0]:
        prefixes[arms[0]] = base
    return prefixes


def _base(bag: Bag) -> str:
    """Common prefix of all topics of the arms that the metadata name."""
    namespace = bag.metadata.get(NAMESPACE_KEY, "").strip("/")
    return f"{namespace}/" if namespace else ""


class _ArmBag(Bag):
    """Recording of one arm: a view of a recording of several arms.

    Args:
        bag: The whole recording.
        prefix: Prefix of the arm's topic names; empty for the default arm.
        prefixes: Prefix of the topic names of each arm.
        base: Common prefix of all topics. Names of metadata texts do not have this prefix.
    """

    def __init__(self, bag: Bag, prefix: str, prefixes: tuple[str, ...], base: str) -> None:
        self._bag, self._prefix, self._prefixes, self._base = bag, prefix, prefixes, base
        # Texts whose name has no arm belong to the default arm, if there is a default arm.
        self._foreign = _OF_ONE_ARM if base in prefixes else set[str]()
        self.path, self.start_ns, self.end_ns = bag.path, bag.start_ns, bag.end_ns
        self.topics: dict[str, TopicInfo] = {}
        for name, info in bag.topics.items():
            plain = name if name == DIAGNOSTICS.name else self._own_name(name)
            if plain is not None:
                self.topics[plain] = info
        self.metadata = self._metadata(bag.metadata)

    def _metadata(self, texts: dict[str, str]) -> dict[str, str]:
        """Metadata of this arm; texts of the arm itself replace texts for all arms."""
        common = texts if self._prefix != self._base else {}
        own = {self._own_name(f"{self._base}{name}"): text for name, text in texts.items()}
        return {
            **{name: text for name, text in common.items() if name not in self._foreign},
            **{name: text for name, text in own.items() if name is not None},
        }

    def _own_name(self, name: str) -> str | None:
        """Name without the arm's prefix; None if the name belongs to another arm."""
        below = tuple(p for p in self._prefixes if p != self._prefix and p.startswith(self._prefix))
        is_own = name.startswith(self._prefix) and not name.startswith(below)
        return name.removeprefix(self._prefix) if is_own else None

    def _recorded(self, topic: Topic | str) -> str:
        name = topic.name if isinstance(topic, Topic) else topic.removeprefix("/")
        return name if name == DIAGNOSTICS.name else self._prefix + name

    def require(self, topics: Iterable[Topic | str]) -> None:
        """Make sure that each topic has at least one message of this arm; the error message names the arm."""
        try:
            super().require(topics)
        except RecordingError as error:
            arm = f"arm {self._prefix.rstrip('/')}" if self._prefix else "the default arm"
            raise RecordingError(self.path, f"{arm} {error.reason}") from None

    def read_many(self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None = None) -> dict[str, Series]:
        """See :meth:`~teleop_core.bags.reader.Bag.read_many`; only topics of this arm."""
        return self._renamed(self._bag.read_many(self._wanted(topics), joint_names))

    def blocks(
        self, topics: Iterable[Topic | str], joint_names: tuple[str, ...] | None = None
    ) -> Iterator[dict[str, Series]]:
        """See :meth:`~teleop_core.bags.reader.Bag.blocks`; only topics of this arm."""
        yield from map(self._renamed, self._bag.blocks(self._wanted(topics), joint_names))

    def reports(self, topic: Topic | str) -> list[Report]:
        """All reports of a topic; those of ``diagnostics`` are only the reports of the arm's own nodes."""
        self.require([topic])
        found = self._bag.reports(self._recorded(topic))
        if self._recorded(topic) != DIAGNOSTICS.name:
            return found
        named = [(self._own_name(report.name.strip("/")), report) for report in found]
        return [report._replace(name=name) for name, report in named if name is not None]

    def raw(self, topics: Iterable[Topic | str] | None = None) -> Iterator[tuple[str, str, int, bytes]]:
        """See :meth:`~teleop_core.bags.reader.Bag.raw`; only topics of this arm."""
        if topics is None:
            topics = [name for name, info in self.topics.items() if info.count]
        for name, ros_type, log_ns, data in self._bag.raw(self._wanted(topics)):
            yield name.removeprefix(self._prefix), ros_type, log_ns, data

    def _wanted(self, topics: Iterable[Topic | str]) -> list[str]:
        wanted = list(topics)
        self.require(wanted)
        return [self._recorded(topic) for topic in wanted]

    def _renamed(self, block: dict[str, Series]) -> dict[str, Series]:
        return {name.removeprefix(self._prefix): series for name, series in block.items()}
