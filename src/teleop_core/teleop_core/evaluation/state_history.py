"""State history: values of teleop/state over time, as columns and fixtures."""

import warnings
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import kept_files, messages, reader
from teleop_core.base import EvaluationError, TeleopWarning
from teleop_core.coupling.fixtures.reported_fixture import ReportedFixture, reported_fixture
from teleop_core.evaluation.accumulators import Integers
from teleop_core.evaluation.pairing import NONE, latest
from teleop_core.graph import STATE, STATE_FIELDS, topics
from teleop_core.kernels.geometry import Array

_CENTER = slice(STATE["fixture_center_x"], STATE["fixture_center_x"] + 3)
# Values of the fields that recordings of earlier versions lack.
_SINCE = {"limit": "nan", "limited_joint": "nan"}
_SIZE = slice(STATE["fixture_size_x"], STATE["fixture_size_x"] + 3)


@dataclass(frozen=True, eq=False)
class StateHistory:
    """Changes of the state, in the order of their stamps.

    Attributes:
        stamp_ns: Time from which each row is valid, shape (N,), [ns].
        rows: Columns as in :data:`~teleop_core.graph.signals.STATE_FIELDS`, shape (N, 13).
        fixture: Index in ``fixtures`` of each row's fixture, shape (N,).
        fixtures: All reported fixtures, each once, whether it was on or off.
    """

    stamp_ns: Integers
    rows: Array
    fixture: Integers = field(default_factory=lambda: np.empty(0, np.int64))
    fixtures: tuple[ReportedFixture, ...] = ()

    def at(self, stamp_ns: Integers) -> "States":
        """State in force at each stamp, shape (N,), [ns]; all zero before the first report."""
        index = latest(stamp_ns, self.stamp_ns)
        if not len(self.rows):
            return States(np.zeros((len(stamp_ns), len(STATE_FIELDS))), index, ())
        rows = np.where((index != NONE)[:, None], self.rows[index], 0.0)
        return States(rows, self.fixture[index], self.fixtures)


@dataclass(frozen=True, eq=False)
class States:
    """State at N times; the attributes are as in :class:`StateHistory`."""

    rows: Array
    fixture: Integers
    fixtures: tuple[ReportedFixture, ...]

    def column(self, name: str) -> Array:
        """One field, shape (N,)."""
        return self.rows[:, STATE[name]]

    @property
    def is_fixture_on(self) -> NDArray[np.bool_]:
        """Whether the fixture is on, shape (N,)."""
        return self.column("is_fixture_on") > 0.0

    def only(self, is_kept: NDArray[np.bool_]) -> "States":
        """States at the times for which ``is_kept``, shape (N,), is True."""
        if is_kept.all():
            return self
        return States(self.rows[is_kept], self.fixture[is_kept], self.fixtures)

    def fixture_counts(self) -> dict[ReportedFixture, int]:
        """Reported fixtures, on or off, and the number of times at which each was reported."""
        counts = np.bincount(self.fixture).tolist()
        return {self.fixtures[index]: count for index, count in enumerate(counts) if count}

    def is_told(self, fixture: ReportedFixture) -> NDArray[np.bool_]:
        """Whether this fixture is reported, on or off, shape (N,)."""
        return self.fixture == self.fixtures.index(fixture)

    @property
    def center(self) -> Array:
        """Middle of the fixture in the slave's base, shape (N, 3), [m]."""
        return self.rows[:, _CENTER]

    @property
    def size(self) -> Array:
        """Extent of the fixture on the slave's x, y, z, shape (N, 3), [m]."""
        return self.rows[:, _SIZE]


NO_HISTORY: StateHistory = StateHistory(np.empty(0, np.int64), np.empty((0, len(STATE_FIELDS))))
"""History of a recording without teleop/state."""


def read_history(bag: reader.Bag) -> StateHistory:
    """State history of a recording; empty if it has no teleop/state.

    Reports of other writers that lack a field, or have a field that is not a number, are left out with a warning.

    Raises:
        EvaluationError: No report can be read.
        RecordingError: The topic does not contain reports.
    """
    info = bag.topics.get(topics.TELEOP_STATE.name)
    stamps: list[int] = []
    rows: list[Array] = []
    fixtures: dict[ReportedFixture, int] = {}
    which: list[int] = []
    wrong: list[EvaluationError] = []
    files = kept_files.recorded_files(bag.metadata)
    for report in bag.reports(topics.TELEOP_STATE) if info is not None and info.count else ():
        try:
            row = _row(bag, report)
            fixture = reported_fixture(report.values, row[_SIZE], files)
        except EvaluationError as error:
            wrong.append(error)
            continue
        stamps.append(report.stamp_ns)
        rows.append(row)
        which.append(fixtures.setdefault(fixture, len(fixtures)))
    if wrong and not rows:
        raise wrong[0]
    if wrong:
        warnings.warn(f"{wrong[0]}; reports left out: {len(wrong)}", TeleopWarning, stacklevel=2)
    columns = np.array(rows).reshape(len(rows), len(STATE_FIELDS))
    times, told = np.array(stamps, np.int64), np.array(which, np.int64)
    order = np.argsort(times, kind="stable")
    return StateHistory(times[order], columns[order], told[order], tuple(fixtures))


def _row(bag: reader.Bag, report: messages.Report) -> Array:
    return np.array([_number(bag, name, report.values.get(name, _SINCE.get(name))) for name in STATE_FIELDS])


def _number(bag: reader.Bag, name: str, text: str | None) -> float:
    if text is None:
        raise EvaluationError(f"{bag.path}: a {topics.TELEOP_STATE.name} report lacks {name}")
    try:
        return float(text)
    except ValueError as error:
        reason = f"{name} is {text!r}, must be a number"
        raise EvaluationError(f"{bag.path}: in {topics.TELEOP_STATE.name}, {reason}") from error
