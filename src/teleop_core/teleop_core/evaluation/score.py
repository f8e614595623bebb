"""Score: all values measured on one arm of a recording, and their keys in JSON."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, NoReturn, TypeVar

from teleop_core.base.errors import EvaluationError, UnknownNameError
from teleop_core.evaluation.accumulators import DelaySpread, Spread
from teleop_core.evaluation.html_table import compact_table
from teleop_core.evaluation.metric import Key
from teleop_core.evaluation.metrics.counts import Counts, Samples, Ticks, TopicScore
from teleop_core.evaluation.metrics.fixture import FixtureScore
from teleop_core.evaluation.metrics.orientation_error import OrientationError
from teleop_core.evaluation.metrics.reach import ReachScore
from teleop_core.evaluation.plain import Leaf, Plain, Values, leaves, plain
from teleop_core.evaluation.registry import METRICS, SESSION
from teleop_core.evaluation.rows import TableRow, number
from teleop_core.evaluation.verdict import Verdict, verdict_of

if TYPE_CHECKING:
    import pandas

VERDICT = "verdict"

SESSION_KEYS = (
    Key("session.name", "1", "name of the recording"),
    Key("session.scenario", "1", "scenario of the recording; null if unknown"),
    Key("session.robot", "1", "name of the robot; null if unknown"),
    Key("session.seed", "1", "random seed; null if unknown"),
    Key("session.duration_s", "s", "duration from the first to the last message"),
    Key("session.gain", "m/m", "gain that was used most of the time; null if unknown"),
    Key("session.arm", "1", "arm that was scored; empty if the recording names no arms"),
    Key("session.plant", "1", "plant of the simulated slave; null if no simulator was recorded"),
    Key("session.controller", "1", "control law of the simulated slave; null if unknown"),
    Key("session.from_s|to_s", "s", "begin and end of the scored span, since the first message"),
    Key("session.missing", "1", "parts named in the recording that are not installed here; null if all are"),
    Key("verdict.text", "1", "one line that summarizes the score, the worst finding first"),
    Key("verdict.worst", "1", "key of the worst finding; null if all values are within their bounds"),
    Key("verdict.advice", "1", "meaning of the worst finding and what to do; null if nothing is wrong"),
)
"""Keys of the data about a recording, in addition to the keys of its metrics."""
Record = TypeVar("Record")


def keys() -> tuple[Key, ...]:
    """All keys of the JSON, in their order. Numbers are finite; null means not applicable.

    Raises:
        PartError: An added metric is not a valid metric.
    """
    return (*SESSION_KEYS, *(key for name in METRICS for key in METRICS.find(name).keys))


def key_table() -> str:
    """The keys as a Markdown table, for documents."""
    rows = (f"| `{key.path.replace('|', ', ')}` | {key.unit} | {key.meaning} |" for key in keys())
    return "\n".join(("| key | unit | meaning |", "|---|---|---|", *rows))


@dataclass(frozen=True)
class ScoredRecording:
    """The scored recording. Its texts come from the metadata of the recording; a text that the metadata lack is None.

    ``arm`` is empty for the default arm of a recording that names no arms. ``from_s`` and ``to_s`` are the begin and
    end of the scored part, since the first message; None means the last message. ``missing`` lists the parts that the
    recording names but that are unknown here.
    """

    name: str
    scenario: str | None
    robot: str | None
    seed: int | None
    duration_s: float
    gain: float | None
    arm: str = ""
    from_s: float = 0.0
    to_s: float | None = None
    plant: str | None = None
    controller: str | None = None
    missing: str | None = None

    @property
    def facts(self) -> tuple[str, ...]:
        """Texts of scenario, robot, arm, seed, duration and gain; unknown facts are left out."""
        found = (
            self.scenario and f"scenario {self.scenario}",
            self.robot and f"robot {self.robot}",
            self.plant and f"{self.plant} plant",
            self.controller and f"controller {self.controller}",
            self.arm and f"arm {self.arm}",
            None if self.seed is None else f"seed {self.seed}",
            f"{self.duration_s:.1f} s",
            None if self.gain is None else f"gain {self.gain:g}",
            self.is_part and f"scored from {self.from_s:g} to {self.to_s:g} s",
        )
        return tuple(fact for fact in found if fact)

    @property
    def is_part(self) -> bool:
        """Whether only a span of the recording was scored."""
        end = self.duration_s if self.to_s is None else self.to_s
        return self.from_s > 0.0 or end < self.duration_s

    @property
    def title(self) -> str:
        """Name that users see: the scenario if it is known, otherwise the name of the recording."""
        return self.scenario or self.name

    @property
    def place(self) -> str:
        """Name of the recording, and of the arm if it has one."""
        return f"{self.name} · {self.arm}" if self.arm else self.name


@dataclass(frozen=True)
class Result:
    """Results of one metric.

    Attributes:
        name: Name of the metric.
        place: Name under which the metric's keys appear in JSON.
        values: Return value of its ``values()``.
        json: The values as plain dictionaries; None for a metric without keys.
        rows: Rows of tables.
    """

    name: str
    place: str
    values: Values
    json: dict[str, Plain] | None
    rows: tuple[TableRow, ...]


class _Found(Generic[Record]):
    """Attribute of a score: values of the metric with the attribute's name, of a given type."""

    def __init__(self, kind: type[Record]) -> None:
        self._kind = kind

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, score: "Score | None", owner: type) -> Record:
        if score is None:
            return self  # type: ignore[return-value]
        return score.record(self._name, self._kind)


@dataclass(frozen=True, repr=False)
class Score:
    """Score of one arm of a recording; :func:`keys` describes each entry.

    Values of this package's metrics are attributes; :meth:`value` returns values of any metric.

    Attributes:
        session: The scored recording and arm.
        results: Results of each metric, in the order of the metrics.
    """

    session: ScoredRecording
    results: tuple[Result, ...]

    def value(self, key: str) -> float | None:
        """Number under a key, such as ``"fixture.penetration_max_mm"``; None if not applicable.

        Raises:
            UnknownNameError: There is no such key; the error lists the alternatives.
            EvaluationError: The value under this key is a text.
        """
        found = self.to_dict()
        if key not in found:
            metric = key.partition(".")[0]
            near = [name for name in found if name.startswith(f"{metric}.")]
            raise UnknownNameError("key of a score", key, near or found)
        value = found[key]
        if isinstance(value, str):
            raise EvaluationError(f"{key} of {self.session.place} is {value!r}, must be a number")
        return value

    def record(self, metric: str, kind: type[Record]) -> Record:
        """Return value of a metric's ``values()``.

        Args:
            metric: Name of the metric.
            kind: Type of the return value: ``Spread``, a dataclass of the metric, or ``dict``.

        Raises:
            UnknownNameError: There is no such metric; the error lists the alternatives.
            EvaluationError: The metric returned another type.
        """
        for result in self.results:
            if result.name == metric:
                if isinstance(result.values, kind):
                    return result.values
                found = type(result.values).__name__
                raise EvaluationError(f"{metric} gives a {found}, must be a {kind.__name__}")
        raise UnknownNameError("metric", metric, [result.name for result in self.results])

    def __getattr__(self, name: str) -> NoReturn:
        """Raise an error that explains how to read the values of a user's metrics."""
        hint = f"{name!r} does not exist; read a metric's value with score.value({name + '.rms'!r})"
        raise AttributeError(f"attribute of a Score: {hint}")

    @property
    def verdict(self) -> Verdict:
        """One line about the score that names the worst problem first."""
        return verdict_of(_by_key(self._found()))

    def to_json(self) -> dict[str, Plain]:
        """The score as plain dictionaries with the keys of :func:`keys`."""
        session, *found = self._found().items()
        return dict([session, (VERDICT, plain(self.verdict)), *found])

    def _found(self) -> dict[str, Plain]:
        """The score without the verdict: the session, then each metric that has keys."""
        found: dict[str, dict[str, Plain]] = {SESSION: plain(self.session)}
        for result in self.results:
            if result.json is not None:
                found.setdefault(result.place, {}).update(result.json)
        return dict(found)

    @property
    def rows(self) -> list[TableRow]:
        """Rows of the table. Rows of one group are together, at the position of the group's first row."""
        groups: dict[str, list[TableRow]] = {}
        for result in self.results:
            for row in result.rows:
                groups.setdefault(row.group, []).append(row)
        return [row for rows in groups.values() for row in rows]

    def to_dict(self) -> dict[str, Leaf]:
        """Every value by its key, in one dictionary: a row of a data frame."""
        return _by_key(self.to_json())

    def __repr__(self) -> str:
        error = self.position_error_mm
        return (
            f"Score of {self.session.place}: {', '.join(self.session.facts)}\n"
            f"{self.verdict}\n"
            f"position error {number(error.rms)} mm RMS, {number(error.max)} mm at most"
        )

    def _repr_html_(self) -> str:
        return compact_table(self.session.place, self.session.facts, self.verdict.text, self.rows)

    # -- the metrics of this package, typed ------------------------------------------------------

    samples = _Found(Samples)
    """Number of scored slave poses."""
    reach = _Found(ReachScore)
    """Share of the time in which the slave followed the hand, and why it could not follow otherwise."""
    asked_error_mm = _Found(Spread)
    """Distance of the slave's tip from the position that the hand asked for, [mm]."""
    asked_error_deg = _Found(Spread)
    """Angle between the tool and the orientation that the hand asked for, [deg]."""
    position_error_mm = _Found(Spread)
    """Distance of the slave's tip from its reference, [mm]."""
    orientation_error_deg = _Found(OrientationError)
    """Angles between the slave's tip and its reference, [deg]."""
    true_error_mm = _Found(Spread)
    """Distance of the true tip from its reference, [mm]; values are None if the true tip was not recorded."""
    command_error_mm = _Found(Spread)
    """Distance of the slave's tip from the newest command, [mm]."""
    command_orientation_error_deg = _Found(OrientationError)
    """Angles between the slave's tip and the newest command, [deg]."""
    fixture = _Found(FixtureScore)
    """How far hand and slave left the virtual fixture."""
    force_n = _Found(Spread)
    """Magnitude of the force on the hand, [N]."""
    latency_ms = _Found[dict[str, DelaySpread]](dict)
    """Delay of each stage and of the whole chain, [ms]."""
    ticks = _Found(Ticks)
    """Control ticks of the slave."""
    nodes = _Found[Counts](dict)
    """Last reported counts of the nodes."""
    topics = _Found[dict[str, TopicScore]](dict)
    """Messages of each topic and how many are missing."""


def _by_key(tree: Mapping[str, Plain]) -> dict[str, Leaf]:
    return {".".join(path): value for path, value in leaves(tree).items()}


def frame_of(scores: Iterable[Score]) -> "pandas.DataFrame":
    """Scores as a data frame: one row per score, one column for each key that any score has."""
    import pandas

    return pandas.DataFrame([score.to_dict() for score in scores])
