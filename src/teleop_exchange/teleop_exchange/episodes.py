"""Episodes: a table that contains several recordings, as in data sets; an import reads one of them.

One column numbers them, such as ``episode_index``; or several columns do, such as ``stage`` and ``trial``. The rows of
an episode stand together in the file: rows in several places are several recordings, which nothing may join.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import ParameterError, RecordingError, UnknownNameError
from teleop_exchange import names, tables
from teleop_exchange.options import ImportOptions, option

_LISTED = 8
_NEEDED = "left out: no column is called episode_index or the like; --numbered-by COL names one"
_JUMP = 10.0  # a step of this many usual ones is a jump of the time
_NONE = -1.0
"""Number of rows without an episode."""


class Episodes:
    """Rows of the wanted episode; all rows if the table contains only one episode.

    Args:
        table: The table.
        options: Import options: ``episode`` is the number of the wanted episode; None if the table must contain only
            one.

    Raises:
        ParameterError: A number of an episode is given, but no column contains the episode numbers.
        UnknownNameError: A column does not exist.
    """

    def __init__(self, table: tables.Table, options: ImportOptions) -> None:
        self._table, self._wanted = table, None if options.episode == "all" else options.episode
        self._columns = _columns(table, options)
        self._beside = [] if options.numbered_by or not table.is_named else _beside(table, self._columns)
        self._texts = {
            column: table.number_texts(column)
            for column in (*self._columns, *self._beside)
            if not np.isfinite(table.sample(column)).any()
        }
        self._numbering = _Numbering(len(self._columns))
        self._finer = _Numbering(len(self._columns) + len(self._beside))
        self._times: list[NDArray[np.float64]] = []
        if self._wanted is not None and not self._columns:
            raise ParameterError("--episode", self._wanted, _NEEDED)

    def blocks(self, columns: list[int], has_time: bool = False) -> Iterator[list[tables.Numbers]]:
        """Some columns of the table, block by block.

        Args:
            columns: The columns.
            has_time: Whether the first column is the time.

        Raises:
            RecordingError: The table contains several episodes and no number is given, or an episode is several
                recordings, or the file is damaged.
            UnknownNameError: No episode has the given number.
        """
        if not self._columns and not self._beside:
            yield from self._table.blocks(columns)
            return
        first = len(columns) + len(self._columns)
        for block in self._table.blocks([*columns, *self._columns, *self._beside]):
            is_own = np.ones(len(block[-1]), np.bool_)
            if self._columns:
                episode = self._numbering.numbers(block[len(columns) : first])
                is_own = is_own if self._wanted is None else episode == self._wanted
            self._finer.numbers([column[is_own] for column in block[len(columns) :]])
            own = [column[is_own] for column in block[: len(columns)]]
            self._times += [own[0].astype(np.float64)] * (has_time and bool(self._beside))
            yield own
        if self._columns:
            self._check()
        self._refuse_breaks()

    def _check(self) -> None:
        found = self._numbering.begins
        listed = [f"{number:g}" for number in sorted(found)]
        if self._wanted is not None and self._wanted not in found:
            raise UnknownNameError("--episode", self._wanted, listed)
        named = " and ".join(repr(self._table.names[column]) for column in self._columns)
        if self._wanted is None and len(listed) > 1:
            few = ", ".join(listed) if len(listed) < _LISTED else f"{listed[0]} to {listed[-1]}"
            reason = f"holds {len(listed)} episodes (column {named}: {few})"
            hint = "take one by --episode N, or each by --episode all"
            raise RecordingError(self._table.path, f"{reason}; {hint}")
        begins = next(iter(found.values()), []) if self._wanted is None else found[self._wanted]
        if len(begins) > 1:
            rows = ", ".join(str(row + 1) for row in begins[:_LISTED])
            which = "its only episode" if self._wanted is None else f"episode {self._wanted}"
            reason = f"has the rows of {which} in {len(begins)} places, from the rows {rows} on: {named} alone does not"
            hint = f"number its recordings; name all columns that do: --numbered-by {self._told_columns()}"
            raise RecordingError(self._table.path, f"{reason} {hint}")

    def _refuse_breaks(self) -> None:
        """Refuse an episode in which another column changes where the time jumps.

        Raises:
            RecordingError: The time jumps there.
        """
        times = np.concatenate(self._times) if self._times else np.zeros(0)
        steps, begins = np.diff(times), [row for rows in self._finer.begins.values() for row in rows]
        rising = steps[steps > 0.0]
        usual = float(np.median(rising)) if len(rising) else 0.0
        broken = sorted(row for row in begins if 0 < row < len(times) and not 0.0 <= steps[row - 1] <= _JUMP * usual)
        if broken:
            listed = ", ".join(str(row + 1) for row in broken[:_LISTED])
            where = " in an episode" if self._columns else ""
            reason = (
                f"holds {len(broken) + 1} recordings{where}: the time jumps where another number changes, in its row"
            )
            hint = f"give --numbered-by {self._told_columns()}, or --numbered-by none if it is one recording"
            raise RecordingError(self._table.path, f"{reason} {listed}; {hint}")

    def _told_columns(self) -> str:
        """Columns that may number the recordings, for a message."""
        listed = [self._table.names[column] for column in (*self._beside, *self._columns)]
        return " ".join(listed if self._beside else ["COL", *listed])

    def told(self) -> list[str]:
        """Texts about the imported episode."""
        changes = len(self._finer.begins) - 1
        finer = f"another number changes {changes} times in it (recordings of their own: --numbered-by "
        finer += f"{self._told_columns()})"
        return self._told_episode() + [finer] * (bool(self._columns and self._beside) and changes > 0)

    def _told_episode(self) -> list[str]:
        if self._wanted is None:
            return []
        values = zip(self._columns, self._numbering.values_of(self._wanted), strict=True)
        named = ", ".join(f"{self._table.names[column]} {self._value(column, value)}" for column, value in values)
        more = f" ({named})" * (len(self._columns) > 1)
        return [f"episode {self._wanted} of {len(self._numbering.begins)}{more}"]

    def _value(self, column: int, number: float) -> str:
        return self._texts[column].text(number) if column in self._texts else f"{number:g}"


class _Numbering:
    """Numbers of the episodes of a table, block by block.

    One column has these numbers itself; the combinations of several columns are numbered from 0 in their order.

    Attributes:
        begins: Row at which each stretch of an episode begins, by the number of the episode.
    """

    def __init__(self, count: int) -> None:
        self._count, self._known = count, dict[tuple[float, ...], float]()
        self._last, self._rows, self.begins = _NONE, 0, dict[float, list[int]]()

    def numbers(self, columns: list[tables.Numbers]) -> NDArray[np.float64]:
        """Number of the episode of each row of the next block."""
        rows = np.column_stack(columns).astype(np.float64)
        found = np.full(len(rows), _NONE)
        is_known = np.isfinite(rows).all(axis=1)
        changes = np.ones(len(rows), np.bool_)
        changes[1:] = (rows[1:] != rows[:-1]).any(axis=1)
        starts = np.flatnonzero(is_known & changes)
        for start, end in zip(starts, np.append(starts, len(rows))[1:], strict=True):
            number = self._number(tuple(rows[start].tolist()))
            found[start:end] = number
            if number != self._last:
                self.begins.setdefault(number, []).append(self._rows + int(start))
                self._last = number
        found[~is_known] = _NONE
        self._rows += len(rows)
        return found

    def _number(self, values: tuple[float, ...]) -> float:
        return values[0] if self._count == 1 else self._known.setdefault(values, float(len(self._known)))

    def values_of(self, number: float) -> tuple[float, ...]:
        """Values of the columns of an episode."""
        return next((values for values, one in self._known.items() if one == number), (float(number),))


def numbers_of(table: tables.Table, options: ImportOptions) -> list[int]:
    """Numbers of the episodes of a table.

    Raises:
        ParameterError: No column contains the episode numbers.
    """
    columns = _columns(table, options)
    if not columns:
        raise ParameterError("--episode", "all", _NEEDED)
    numbering = _Numbering(len(columns))
    for column in columns:
        if not np.isfinite(table.sample(column)).any():
            table.number_texts(column)
    for block in table.blocks(columns):
        numbering.numbers(block)
    return sorted(map(int, numbering.begins))


def _beside(table: tables.Table, columns: list[int]) -> list[int]:
    """Further columns of numbers or names that may number recordings too."""
    found = [column for column in names.find_numberings(table.names) if column not in columns]
    known = [np.isfinite(table.sample(column)) for column in found]
    return [column for column, own in zip(found, known, strict=True) if own.all() or not own.any()]


def _columns(table: tables.Table, options: ImportOptions) -> list[int]:
    """Columns that number the episodes; empty if there are none."""
    if options.numbered_by == ("none",):
        return []
    if options.numbered_by:
        return [tables.column_of(table, name, option("numbered_by")) for name in options.numbered_by]
    column = names.find_episode(table.names) if table.is_named else None
    return [column] if column is not None and np.isfinite(table.sample(column)).all() else []
