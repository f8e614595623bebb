"""Tables: files of rows and columns, CSV and Parquet, read in blocks of rows."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from teleop_core.base import RecordingError, UnknownNameError, damage_told
from teleop_exchange import dates

Numbers = NDArray[np.float64] | NDArray[np.int64]
"""Values of a column; they are integers if the file contains integers, such as times in nanoseconds."""
ROWS = 65_536
"""Approximate number of rows of a block."""
SAMPLE = 1000
"""Number of rows that are examined before reading."""


class Table(Protocol):
    """A file of rows and columns.

    Attributes:
        path: Path of the file.
        names: Names of the columns; columns without a name are called ``column 4``, counted from 1.
        is_named: Whether the file contains the names.
        bad_rows: Number of rows left out so far because they have too few or too many cells.
    """

    path: Path
    names: tuple[str, ...]
    is_named: bool
    bad_rows: int

    def sample(self, column: int) -> Numbers:
        """The first values of a column, up to :data:`SAMPLE`; NaN for values that are not numbers."""

    def is_clock(self, column: int) -> bool:
        """Whether a column contains dates, which are read as nanoseconds since 1970."""

    def number_texts(self, column: int) -> "Texts":
        """Make :meth:`blocks` read a column as texts, numbered in the order of their appearance."""

    def blocks(self, columns: Sequence[int]) -> Iterator[list[Numbers]]:
        """Some columns, block by block.

        Raises:
            RecordingError: A cell is not a number, or the file is damaged.
        """


class Texts:
    """Numbers of texts, in the order of their appearance."""

    def __init__(self) -> None:
        self._known: dict[str | None, int] = {None: -1}

    def numbers(self, texts: "pa.Array") -> Numbers:
        """Number of each text; NaN for missing ones."""
        found = [self._known.setdefault(text, len(self._known) - 1) for text in texts.cast(pa.string()).to_pylist()]
        return np.where(np.array(found, np.int64) < 0, np.nan, np.array(found, np.float64))

    def text(self, number: float) -> str:
        """Text of a number."""
        return str(list(self._known)[int(number) + 1])


def column_of(table: Table, name: str, option: str) -> int:
    """Column by its name or, counted from 1, by its number.

    Raises:
        UnknownNameError: The column does not exist; the message lists all columns.
    """
    if name in table.names:
        return table.names.index(name)
    small = [known.strip().lower() for known in table.names]
    if small.count(name.strip().lower()) == 1:
        return small.index(name.strip().lower())
    if name.isdigit() and 1 <= int(name) <= len(table.names):
        return int(name) - 1
    listed = table.names if table.is_named else (f"1 to {len(table.names)}",)
    raise UnknownNameError(f"column of {option}", name, listed)


def unique(names: Sequence[str]) -> tuple[str, ...]:
    """Names without surrounding blanks; repeated names and empty names get a number."""
    seen: dict[str, int] = {}
    out = []
    for number, name in enumerate(names, start=1):
        text = name.strip().strip('"').strip() or f"column {number}"
        count = seen[text] = seen.get(text, 0) + 1
        out.append(text if count == 1 else f"{text}.{count}")
    return tuple(out)


def _has_dates(column: "pa.ChunkedArray | pa.Array") -> bool:
    """Whether a column contains texts, of which the first is a date."""
    if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
        return False
    first = column.drop_null()
    return len(first) > 0 and dates.is_date(first[0].as_py())


def numbers(column: "pa.ChunkedArray | pa.Array") -> Numbers:
    """Convert a column of Arrow to numbers; missing values become NaN."""
    kind = column.type
    if pa.types.is_timestamp(kind):
        column = column.cast(pa.timestamp("ns", tz=kind.tz)).cast(pa.int64())
    elif pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif pa.types.is_time(kind):
        column = column.cast(pa.time64("ns")).cast(pa.int64())
    elif pa.types.is_duration(kind):
        column = column.cast(pa.duration("ns")).cast(pa.int64())
    elif _has_dates(column):
        return dates.nanoseconds(column.to_pylist())
    elif pa.types.is_decimal(kind) or pa.types.is_string(kind) or pa.types.is_large_string(kind):
        column = column.cast(pa.float64())
    is_whole = pa.types.is_integer(column.type) and not column.null_count
    found = column.to_numpy(zero_copy_only=False) if isinstance(column, pa.Array) else None
    values = column.to_numpy() if found is None else found
    if is_whole:
        return np.asarray(values, np.int64)
    return np.asarray(values, np.float64)


class ParquetTable:
    """A Parquet file; columns of lists of one length are ``name.0``, ``name.1`` and so on.

    Only the wanted columns are read: pictures in the same file cost neither time nor memory.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.is_named, self.bad_rows = path, True, 0
        with damage_told(path, "is no sound Parquet file: {}"):
            # Read on demand, because a file may consist of one single group of rows.
            self._file = pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20)
            self._columns = self._found()
            self._texts: dict[str, Texts] = {}
            self.names = unique([column.name for column in self._columns])

    def _found(self) -> list["_Column"]:
        """All columns, with the first values of those that may hold numbers."""
        leaves = list(_leaves(self._file.schema_arrow))
        readable = [path for path, kind in leaves if _may_be_numbers(kind)]
        for batch in self._file.iter_batches(batch_size=SAMPLE, columns=readable):
            head = flat(batch)
            first = dict(zip(head.schema.names, head.columns, strict=True))
            nothing = pa.nulls(batch.num_rows, pa.float64())
            found = {path: [name for name in first if _is_part(name, path, kind)] for path, kind in leaves}
            return [
                _Column(name, path, first.get(name, nothing), bool(found[path]))
                for path, _ in leaves
                for name in found[path] or [path]
            ]
        raise RecordingError(self.path, "holds no rows")

    def sample(self, column: int) -> Numbers:
        """The first values of a column; NaN for values that are not numbers."""
        first = self._columns[column].first
        try:
            return numbers(first)
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError, ValueError, TypeError):
            return np.full(len(first), np.nan)

    def is_clock(self, column: int) -> bool:
        """Whether a column contains dates, which are read as nanoseconds since 1970."""
        first = self._columns[column].first
        kinds = (pa.types.is_timestamp, pa.types.is_time, pa.types.is_duration)
        return any(is_kind(first.type) for is_kind in kinds) or _has_dates(first)

    def number_texts(self, column: int) -> Texts:
        """Make :meth:`blocks` read a column as texts, numbered in the order of their appearance."""
        return self._texts.setdefault(self._columns[column].name, Texts())

    def blocks(self, columns: Sequence[int]) -> Iterator[list[Numbers]]:
        """Some columns, block by block."""
        wanted = [self._columns[column] for column in columns]
        if unread := [column.name for column in wanted if not column.is_readable]:
            raise RecordingError(self.path, f"column {', '.join(unread)} holds no numbers")
        paths = list(dict.fromkeys(column.path for column in wanted))
        with damage_told(self.path):
            for batch in self._file.iter_batches(batch_size=ROWS, columns=paths):
                whole = flat(batch)
                yield [self._numbers(whole.column(whole.schema.names.index(one.name)), one.name) for one in wanted]

    def _numbers(self, values: pa.Array, name: str) -> Numbers:
        return self._texts[name].numbers(values) if name in self._texts else numbers(values)


class _Column(NamedTuple):
    """A column of a Parquet file: name, path of the part of the file that holds it, first values, may it be read."""

    name: str
    path: str
    first: pa.Array
    is_readable: bool


def _leaves(fields: Iterable[pa.Field], prefix: str = "") -> Iterator[tuple[str, pa.DataType]]:
    """Path and type of each column that is stored by itself; the parts of structures are."""
    for field in fields:
        path = f"{prefix}{field.name}"
        if pa.types.is_struct(field.type):
            yield from _leaves(field.type, f"{path}.")
        else:
            yield path, field.type


def _may_be_numbers(kind: pa.DataType) -> bool:
    """Whether a type is that of numbers, times or texts, or of lists of them, and not that of pictures."""
    if _is_list(kind):
        inner = kind.value_type
        return not pa.types.is_nested(inner) and inner not in {pa.uint8(), pa.int8()} and _may_be_numbers(inner)
    return not (pa.types.is_binary(kind) or pa.types.is_large_binary(kind) or pa.types.is_fixed_size_binary(kind))


def _is_list(kind: pa.DataType) -> bool:
    return bool(pa.types.is_fixed_size_list(kind) or pa.types.is_list(kind) or pa.types.is_large_list(kind))


def _is_part(name: str, path: str, kind: pa.DataType) -> bool:
    """Whether a flat column is the one at a path, or one number of the lists there."""
    is_number = name.startswith(f"{path}.") and name[len(path) + 1 :].isdigit()
    return name == path or (_is_list(kind) and is_number)


def flat(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Return a batch without nested columns; each part of a structure or of lists of equal length becomes a column."""
    names: list[str] = []
    columns: list[pa.Array] = []
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        for part, values in _parts(name, column):
            names.append(part)
            columns.append(values)
    return pa.RecordBatch.from_arrays(columns, names=names)


def _parts(name: str, column: pa.Array) -> Iterator[tuple[str, pa.Array]]:
    kind = column.type
    if pa.types.is_struct(kind):
        for field, values in zip(kind, column.flatten(), strict=True):
            yield from _parts(f"{name}.{field.name}", values)
    elif _is_list(kind):
        width = len(column[0]) if len(column) and column[0].is_valid else 0
        values = column.flatten()
        if width and len(values) == width * len(column):
            for i in range(width):
                yield f"{name}.{i}", values.take(pa.array(np.arange(i, len(values), width)))
        else:
            yield name, pa.nulls(len(column), pa.float64())
    else:
        yield name, column
