"""Text tables: CSV and similar files, with detection of separator, head, decimal sign and compression."""

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from teleop_core.bags.finding import METADATA
from teleop_core.base import RecordingError, damage_told
from teleop_exchange import dates
from teleop_exchange.tables import SAMPLE, Numbers, Texts, numbers, unique

_HEAD_BYTES = 1 << 18
_PACKED = {b"\x1f\x8b": "gzip", b"BZh": "bz2", b"\x28\xb5\x2f\xfd": "zstd"}
_COMMENTS = ("#", "%", "//")
_MISSING = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "n/a", "null", "NULL", "None", "-", "--",
            "inf", "-inf", "Inf", "-Inf")  # fmt: skip
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_NAN = re.compile(r"[+-]?(nan|inf|infinity|null|none|n/?a)", re.I)
_RECORDINGS = {b"\x89MCAP": ".mcap", b"SQLite format 3": ".db3", b"#ROSBAG": ".bag"}
"""First bytes of files of recordings, and their endings."""
_UNPACKERS = {"gzip": "gzip -d", "bz2": "bzip2 -d", "zstd": "zstd -d"}
_MARKS = {b"\xff\xfe\x00\x00": "utf-32", b"\x00\x00\xfe\xff": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Byte order marks of encodings with several bytes a character."""
_EXACT = 1 << 53  # largest integer up to which floating-point numbers are exact
_BLANK = r"\s+"


class Form(NamedTuple):
    """Format of a text table.

    Attributes:
        separator: One character, or the pattern of blanks.
        decimal: Sign before the decimals.
        head: Lines before the first row of numbers.
        names: Names of the columns; empty if there is no head.
        width: Number of columns.
        rows: The first rows as texts.
    """

    separator: str
    decimal: str
    head: int
    names: tuple[str, ...]
    width: int
    rows: list[list[str]]


class TextTable:
    """A table in a text file; see :class:`~teleop_exchange.tables.Table`.

    Args:
        path: The file; it may be compressed by gzip, bzip2 or zstd.
        skip: Lines to leave out at the beginning.

    Raises:
        RecordingError: The file is empty, or is not a text table.
    """

    def __init__(self, path: Path, skip: int = 0) -> None:
        self.path, self.bad_rows, self._texts = path, 0, dict[int, Texts]()
        with damage_told(path):
            with path.open("rb") as file:
                magic = file.read(4)
            self._packed = next((n for sign, n in _PACKED.items() if magic.startswith(sign)), None)
            text, self._encoding = self._beginning()
            self._form = recognised(path, text, skip)
        self.is_named = bool(self._form.names)
        self.names = unique(self._form.names or [""] * self._form.width)

    def _stream(self, encoding: str = "utf8") -> pa.NativeFile:
        """The text in UTF-8, if it has the given encoding."""
        stream = pa.input_stream(str(self.path), compression=self._packed)
        return stream if encoding == "utf8" else pa.transcoding_input_stream(stream, encoding, "utf8")

    def _rows(self) -> pa.NativeFile:
        if self._form.separator != _BLANK:
            return self._stream(self._encoding)
        with self._stream(self._encoding) as stream:
            lines = stream.read().splitlines()
        return pa.BufferReader(b"\n".join(b" ".join(line.split()) for line in lines))

    def _beginning(self) -> tuple[str, str]:
        """The first lines, and the encoding of the text."""
        with self._stream() as stream:
            data = stream.read(_HEAD_BYTES)
        if not data.strip():
            raise RecordingError(self.path, "is empty")
        if encoding := _wide_encoding(data):
            with self._stream(encoding) as stream:
                data = stream.read(_HEAD_BYTES)
        if b"\x00" in data:
            raise RecordingError(self.path, self._no_text(data))
        data = data if len(data) < _HEAD_BYTES else data[: data.rfind(b"\n") + 1] or data
        try:
            return data.decode("utf-8-sig"), encoding or "utf8"
        except UnicodeDecodeError:
            return data.decode("latin-1"), "latin-1"

    def _no_text(self, data: bytes) -> str:
        """Why a file that begins with some bytes is no table, and what to give instead."""
        ending = next((end for sign, end in _RECORDINGS.items() if data.startswith(sign)), "")
        if not ending:
            return "is no text; give CSV, TSV, Parquet, a ROS 2 recording or a ROS 1 .bag"
        folder = self.path.resolve().parent
        if self._packed:
            where = f"its folder {folder}" if (folder / METADATA).exists() else f"its folder with {METADATA}"
            instead = f"give {where}, or " * (ending != ".bag")
            return (
                f"is a packed {ending} of a recording: {instead}unpack it by `{_UNPACKERS[self._packed]} {self.path}`"
            )
        if self.path.name.endswith(".active"):
            return "was not closed by its recorder: make its index by `rosbag reindex`, and give the .bag"
        return f"is a recording whose name must end in {ending}; rename it"

    def sample(self, column: int) -> Numbers:
        """The first values of a column; NaN for values that are not numbers."""
        cells = [row[column] if column < len(row) else "" for row in self._form.rows]
        if self._is_truth(column):
            return np.array([cell.strip().lower() == "true" for cell in cells], np.int64)
        if self.is_clock(column):
            return dates.nanoseconds(["" if cell.strip() in _MISSING else cell for cell in cells])
        if cells and all(re.fullmatch(r"[+-]?\d{1,18}", cell.strip()) for cell in cells):
            return np.array([int(cell) for cell in cells], np.int64)
        return np.array([number(cell, self._form.decimal) for cell in cells], np.float64)

    def is_clock(self, column: int) -> bool:
        """Whether a column contains dates, which are read as nanoseconds since 1970."""
        return any(dates.is_date(cell) for cell in self._filled(column)[:1])

    def number_texts(self, column: int) -> Texts:
        """Make :meth:`blocks` read a column as texts, numbered in the order of their appearance."""
        return self._texts.setdefault(column, Texts())

    def _filled(self, column: int) -> list[str]:
        """The first cells of a column, without those that mark a missing value."""
        cells = [row[column].strip() for row in self._form.rows if column < len(row)]
        return [cell for cell in cells if cell not in _MISSING]

    def _is_truth(self, column: int) -> bool:
        """Whether a column contains ``True`` and ``False``, as pandas and Unity write them."""
        cells = {row[column].strip().lower() for row in self._form.rows if column < len(row)}
        return bool(cells) and cells <= {"true", "false"}

    def blocks(self, columns: Sequence[int]) -> Iterator[list[Numbers]]:
        """Some columns, block by block."""
        self.bad_rows = 0
        with damage_told(self.path):
            try:
                yield from self._read(columns)
            except ValueError as error:
                self._refuse_cell(error)
                raise

    def _read(self, columns: Sequence[int]) -> Iterator[list[Numbers]]:
        form = self._form
        names = [f"c{i}" for i in range(form.width)]
        read = pc.ReadOptions(column_names=names, skip_rows=form.head, block_size=1 << 20)
        separator = " " if form.separator == _BLANK else form.separator
        parse = pc.ParseOptions(delimiter=separator, invalid_row_handler=self._bad_row)
        wanted = list(dict.fromkeys(names[column] for column in columns))
        convert = pc.ConvertOptions(
            include_columns=wanted,
            null_values=list(_MISSING),
            strings_can_be_null=True,
            quoted_strings_can_be_null=True,
            decimal_point=form.decimal,
            column_types={names[c]: self._type(c) for c in columns},
        )
        with self._rows() as stream, pc.open_csv(stream, read, parse, convert) as reader:
            for batch in reader:
                yield [self._numbers(batch.column(names[column]), column) for column in columns]

    def _numbers(self, values: pa.Array, column: int) -> Numbers:
        return self._texts[column].numbers(values) if column in self._texts else numbers(values)

    def _type(self, column: int) -> pa.DataType:
        if column in self._texts:
            return pa.string()
        if self.is_clock(column):
            has_zone = dates.has_zone(self._filled(column))
            return pa.string() if has_zone is None else pa.timestamp("ns", tz="UTC" if has_zone else None)
        if self._is_truth(column):
            return pa.bool_()
        # If a column begins with integers, later numbers may have decimals. Only integers that need all digits are
        # read as integers.
        sample = self.sample(column)
        is_long = sample.dtype.kind == "i" and np.abs(sample).max() > _EXACT
        return pa.int64() if is_long else pa.float64()

    def _bad_row(self, row: pc.InvalidRow) -> str:
        self.bad_rows += 1
        return "skip"

    def _refuse_cell(self, error: ValueError) -> None:
        """Raise an error with the column and its bad cell, if a library's error names both.

        Raises:
            RecordingError: The library's error names the column and the cell.
        """
        text = " ".join(str(error).split())
        for pattern in (r"column #(\d+).*?invalid value '([^']*)'", r"to float.*?(): '([^']*)'"):
            if found := re.search(pattern, text):
                name = f"column {self.names[int(found[1])]!r}" if found[1] else "a column"
                needed = "which is no number; choose other columns, or mark it as NaN"
                if dates.looks_like_date(found[2]):
                    needed = f"a date of another form; {dates.FORMS}"
                reason = f"{name} holds {found[2]!r}, {needed}"
                raise RecordingError(self.path, reason) from error


def _wide_encoding(data: bytes) -> str:
    """Encoding with several bytes a character, by its mark or, without one, by its zeros; empty for another."""
    for mark, encoding in _MARKS.items():
        if data.startswith(mark):
            return encoding
    for encoding, first in (("utf-16-le", 1), ("utf-16-be", 0)):
        high, low = data[first:1024:2], data[1 - first : 1024 : 2]
        if len(high) > 8 and high.count(0) > 0.9 * len(high) and not low.count(0):
            return encoding
    return ""


def recognised(path: Path, text: str, skip: int = 0) -> Form:
    """Format of a text table, detected from its beginning.

    Raises:
        RecordingError: The text has no row of numbers.
    """
    lines = text.splitlines()
    first, comment = skip, ""
    while first < len(lines) and (not lines[first].strip() or lines[first].lstrip().startswith(_COMMENTS)):
        comment = lines[first].strip().lstrip("#%/").strip() or comment
        first += 1
    body = [line for line in lines[first:] if line.strip()][: SAMPLE + 2]
    if not body:
        raise RecordingError(path, "contains no rows of numbers")
    separator = _separator(body)
    rows = [cells(line, separator) for line in body]
    with_numbers = [row for row in rows if _has_numbers(row)]
    width = Counter(map(len, with_numbers)).most_common(1)[0][0] if with_numbers else 0
    # Lines before the table, such as `NO_OF_FRAMES 720`, may contain numbers, but fewer than a row of the table.
    begin = next((i for i, row in enumerate(rows) if len(row) == width and _has_numbers(row)), None)
    if begin is None:
        reason = "contains no rows of numbers" if len(rows) < 3 else "contains text, not numbers"
        raise RecordingError(path, reason)
    head = [comment_cells for comment_cells in [cells(comment, separator)] if not begin]
    head = rows[:begin] or head
    names = _head(head, width)
    skipped = _lines_before(lines, first, begin)
    decimal = "," if separator != "," and _has_decimal_commas(rows[begin:]) else "."
    return Form(separator, decimal, skipped, names, width, rows[begin : begin + SAMPLE])


def _lines_before(lines: list[str], first: int, count: int) -> int:
    """Number of lines before the next line that is not empty, after ``count`` such lines are skipped."""
    for number in range(first, len(lines)):
        if lines[number].strip():
            if not count:
                return number
            count -= 1
    return len(lines)


def _head(rows: list[list[str]], width: int) -> tuple[str, ...]:
    """Names of the columns from the lines before the numbers; units from a second line are appended to the names.

    The line of names is the last line with as many cells as the table has columns. A line of units may follow it.
    """
    padded = [[*row, ""] if len(row) == width - 1 else _cut(row, width) for row in rows]
    fitting = [row for row in padded if len(row) == width and any(cell.strip() for cell in row)]
    fitting = [row for row in fitting if not _has_numbers(row)]
    if not fitting:
        return ()
    units = [cell.strip().strip("[]()") for cell in fitting[-1]]
    if len(fitting) > 1 and all(len(unit) <= 4 for unit in units):
        return tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(fitting[-2], units, strict=True))
    return tuple(fitting[-1])


def _cut(row: list[str], width: int) -> list[str]:
    """Remove empty cells after the first ``width`` cells of a row; they come from a separator at the end of a line."""
    return row if any(cell.strip() for cell in row[width:]) else row[:width]


def cells(line: str, separator: str) -> list[str]:
    """Cells of a line."""
    if separator == _BLANK:
        return line.split()
    return next(csv.reader([line], delimiter=separator))


def _separator(lines: list[str]) -> str:
    tried = lines[:50]
    for separator in ("\t", ";", ",", "|"):
        counts = [line.count(separator) for line in tried]
        rows = [line for line in tried if _has_numbers(cells(line, separator))]
        if min(counts[-len(counts) // 2 :]) >= 1 and rows:
            return separator
    return _BLANK


def _has_numbers(row: list[str]) -> bool:
    """Whether a row consists of numbers, some of which may be missing, and at most a few texts."""
    texts = [text for cell in row if (text := cell.strip())]
    found = sum(bool(_NUMBER.fullmatch(text) or _NAN.fullmatch(text)) for text in texts)
    return found >= 1 and 2 * found >= len(texts)


def _has_decimal_commas(rows: list[list[str]]) -> bool:
    found = [cell for row in rows[:50] for cell in row if _NUMBER.fullmatch(cell.strip())]
    return any("," in cell for cell in found) and not any("." in cell for cell in found)


def number(cell: str, decimal: str) -> float:
    """Number in a cell; NaN if the cell is not a number."""
    try:
        return float(cell.strip().replace(decimal, "."))
    except ValueError:
        return float("nan")
