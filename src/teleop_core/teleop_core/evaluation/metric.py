"""Metric: one quantity that is measured on a recording. Each metric is one file, in this package or by a user."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import Field, field, fields, is_dataclass
from itertools import product
from typing import Any, ClassVar, NamedTuple

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.plain import Leaf, Values, leaves, plain
from teleop_core.evaluation.rows import TableRow, error_rows, row
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array

SPREAD_MEANING = "rms, sample S.D. (n − 1), largest"
"""Meaning of the keys ``rms``, ``sd`` and ``max`` of a :class:`Spread`, for descriptions of keys."""


class Key(NamedTuple):
    """A JSON key: path with dots, unit, and meaning.

    In a path, ``<…>`` means any name, and ``|`` separates alternative names. The unit of counts and shares is 1.
    """

    path: str
    unit: str
    meaning: str

    def names(self) -> list[str]:
        """Every single path, with alternatives expanded; ``<…>`` is kept."""
        return [".".join(parts) for parts in product(*self._choices())]

    def covers(self, path: tuple[str, ...]) -> bool:
        """Whether the path of a value matches this key."""
        choices = self._choices()
        return len(choices) == len(path) and all(
            choice[0].startswith("<") or name in choice for choice, name in zip(choices, path, strict=True)
        )

    def _choices(self) -> list[list[str]]:
        return [part.split("|") for part in self.path.split(".")]


def figure(unit: str, meaning: str, label: str = "", **default: object) -> Any:
    """Field of a metric's values, with an optional ``default``; :func:`keys_of` makes the field's key.

    A field with a ``label`` gets a row in tables (see :meth:`Metric.rows`). Tables show shares in per cent.
    """
    return field(metadata={"unit": unit, "meaning": meaning, "label": label}, **default)  # type: ignore[call-overload]


def keys_of(path: str, values: type[Any] | Sequence[Field[Any]], said: str = "") -> tuple[Key, ...]:
    """Keys, below a path, of a dataclass whose fields are all made by :func:`figure`.

    A field that is a :class:`Spread` has the keys ``rms``, ``sd`` and ``max``.

    Args:
        path: Prefix of the fields' names, without the dot.
        values: The dataclass, or some of its fields.
        said: Prefix of the meaning of each key.
    """
    found = fields(values) if isinstance(values, type) else values
    return tuple(
        Key(
            f"{path}.{one.name}{'.rms|sd|max' if one.type is Spread else ''}",
            one.metadata["unit"],
            said + one.metadata["meaning"],
        )
        for one in found
    )


class Metric(ABC):
    """One quantity that is measured on one arm of a recording. Each arm and recording gets a new instance.

    A metric processes the recording window by window. It must store little of each window, so that a recording of any
    length can be scored. Results that several metrics need come from
    :meth:`~teleop_core.evaluation.context.Context.shared` (for the recording) and
    :meth:`~teleop_core.evaluation.windows.Window.once` (for a window).

    The shortest metric declares each value as a :func:`figure`, which is None until it is set. Such a metric needs
    neither ``keys`` nor :meth:`values`::

        class PeakMetric(tc.Metric):
            name, topics = "peak", (SLAVE_TRUE_CF,)
            force_n = figure("N", "largest force along z")

            def add(self, window: Window) -> None:
                force = window.samples(SLAVE_TRUE_CF).values[:, 2]
                self.force_n = max(force.max(initial=0.0), self.force_n or 0.0)

    Attributes:
        name: Name of the metric, also in JSON.
        below: Name of another metric, under which the keys of this metric appear in JSON. If empty, the keys appear
            under the metric's own name.
        group: Group of the metric's table rows. If empty, the group is the name under which the keys appear.
        keys: Keys of the metric in JSON; each path begins with the metric's name and a dot. A metric without keys only
            draws plots and is not in JSON. Keys of fields made by :func:`figure` are added automatically.
        topics: Streams that the metric reads. Streams that a recording lacks have no samples in its windows. For
            streams that depend on the recording see :meth:`~teleop_core.evaluation.context.Context.read`.
        declared: Fields of the class that are made by :func:`figure`; set automatically.
    """

    name: ClassVar[str]
    below: ClassVar[str] = ""
    group: ClassVar[str] = ""
    keys: ClassVar[tuple[Key, ...]] = ()
    topics: ClassVar[tuple[Topic, ...]] = ()
    declared: ClassVar[tuple[Field[Any], ...]] = ()

    def __init_subclass__(cls) -> None:
        """Make the keys for the fields that a subclass made by :func:`figure`, and set each field to None."""
        super().__init_subclass__()
        found = {name: one for name, one in vars(cls).items() if isinstance(one, Field)}
        for name, one in found.items():
            one.name = name
            setattr(cls, name, None)
        if found:
            cls.declared = tuple(found.values())
            cls.keys = keys_of(cls.place(), cls.declared)

    def __init__(self, context: Context) -> None:
        """Construct the metric for one arm of a recording."""
        super().__init__()

    @classmethod
    def place(cls) -> str:
        """Name under which the metric's keys appear in JSON."""
        return cls.below or cls.name

    @abstractmethod
    def add(self, window: Window) -> None:
        """Process one window; ``window.samples(topic)`` returns its samples."""

    def values(self) -> Values:
        """Results: names and values below the metric's name, as declared by its keys.

        None means not applicable, such as a mean without samples. By default, the values are the metric's attributes
        with the names of its keys.
        """
        names = [key.path.removeprefix(f"{self.place()}.") for key in self.keys]
        return {name: getattr(self, name, None) for name in names}

    def rows(self) -> list[TableRow]:
        """Rows of tables.

        By default, this is one row per :func:`figure` that has a label and a value, and no row if all counts are 0. If
        no figure has a label, it is one row per key without ``<…>``.
        """
        values = self.values()
        labels = [
            one for one in (fields(values) if is_dataclass(values) else self.declared) if one.metadata.get("label")
        ]
        if labels:
            of: Mapping[str, Any] = vars(values) if is_dataclass(values) else values
            known = [(one, value) for one in labels if (value := of[one.name]) is not None]
            counts = [value for _, value in known if isinstance(value, int)]
            group = self.group or self.place()
            return [_figure_row(group, *one) for one in known] if any(counts) or not counts else []
        found = {".".join(path): value for path, value in leaves(plain(values)).items()}
        out = []
        for key in self.keys:
            for name in key.names():
                label = name.removeprefix(f"{self.place()}.")
                if "<" not in label:
                    out.append(_row(self.place(), label, key.unit, found.get(label)))
        return out

    def figures(self) -> list[Figure]:
        """Plots for the page, in their order; empty by default."""
        return []


def _figure_row(group: str, one: Field[Any], value: float) -> TableRow:
    label, unit = one.metadata["label"], one.metadata["unit"]
    if isinstance(value, int):
        return TableRow(group, label, "", str(value))
    return row(group, label, "%", 100.0 * value) if unit == "1" else row(group, label, unit, value)


def _row(name: str, label: str, unit: str, value: Leaf) -> TableRow:
    group, text = name.replace("_", " "), label.replace("_", " ").replace(".", " ")
    text, unit = text.removesuffix(f" {unit.replace('/', ' ')}"), "" if unit == "1" else unit
    if isinstance(value, float) or value is None:
        return row(group, text, unit, value)
    return TableRow(group, text, unit, str(value))


class SpreadMetric(Metric):
    """Spread of an error that is computed for every sample.

    Attributes:
        label: Name of the error.
        unit: Unit of the error.
        meaning: Text that states between which two poses the error is measured; it describes the metric's JSON key.
            Empty for a class that declares its own keys.
    """

    label: ClassVar[str] = "position"
    unit: ClassVar[str] = "mm"
    meaning: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        """Make the key of a subclass that has a ``meaning``."""
        super().__init_subclass__()
        if cls.meaning:
            cls.keys = (Key(f"{cls.name}.rms|sd|max", cls.unit, f"{cls.meaning}: {SPREAD_MEANING}"),)

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._error = Moments()

    @abstractmethod
    def errors(self, window: Window) -> Array:
        """Errors (N,) of the samples of a window."""

    def add(self, window: Window) -> None:
        """Process one window."""
        self._error.add(self.errors(window))

    def values(self) -> Spread:
        """Spread so far, in the metric's unit."""
        return self._error.spread()

    def rows(self) -> list[TableRow]:
        """Rows of the root mean square and the maximum."""
        return error_rows(self.group, self.label, self.unit, self.values())
